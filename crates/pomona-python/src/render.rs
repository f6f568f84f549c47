//! Pictures of a row that stands in arrays.

use crate::camera::Calibration;
use crate::pose::{pose, poses};
use crate::threads::detached;
use numpy::ndarray::Axis;
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pomona::{Camera, Pose};
use pomona_render::{Fruit, Leaf, Limb, Row, Scene, Vec3, Weather};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// As many as pictures of recordings may have; each has nine samples of eight bytes while it is drawn.
const MOST_PIXELS: usize = 1 << 26;

type Numbers<'py> = PyReadonlyArray1<'py, f64>;
type Vectors<'py> = PyReadonlyArray2<'py, f64>;

/// `FruitSolids` of the face.
#[derive(FromPyObject)]
struct Fruits<'py> {
    #[pyo3(attribute)]
    ids: PyReadonlyArray1<'py, i64>,
    #[pyo3(attribute)]
    centres_m: Vectors<'py>,
    #[pyo3(attribute)]
    diameters_m: Numbers<'py>,
    #[pyo3(attribute)]
    heights_m: Numbers<'py>,
    #[pyo3(attribute)]
    axes: Vectors<'py>,
    #[pyo3(attribute)]
    ground_colours: Vectors<'py>,
    #[pyo3(attribute)]
    blush_colours: Vectors<'py>,
    #[pyo3(attribute)]
    blush_shares: Numbers<'py>,
    #[pyo3(attribute)]
    blush_directions: Vectors<'py>,
}

/// `Limbs` of the face.
#[derive(FromPyObject)]
struct Limbs<'py> {
    #[pyo3(attribute)]
    starts_m: Vectors<'py>,
    #[pyo3(attribute)]
    ends_m: Vectors<'py>,
    #[pyo3(attribute)]
    start_radii_m: Numbers<'py>,
    #[pyo3(attribute)]
    end_radii_m: Numbers<'py>,
    #[pyo3(attribute)]
    colours: Vectors<'py>,
}

/// `Leaves` of the face.
#[derive(FromPyObject)]
struct Leaves<'py> {
    #[pyo3(attribute)]
    bases_m: Vectors<'py>,
    #[pyo3(attribute)]
    tips: Vectors<'py>,
    #[pyo3(attribute)]
    normals: Vectors<'py>,
    #[pyo3(attribute)]
    lengths_m: Numbers<'py>,
    #[pyo3(attribute)]
    widths_m: Numbers<'py>,
    #[pyo3(attribute)]
    folds_rad: Numbers<'py>,
    #[pyo3(attribute)]
    bends_rad: Numbers<'py>,
    #[pyo3(attribute)]
    colours: Vectors<'py>,
}

/// `RowGeometry` of the face.
#[derive(FromPyObject)]
pub struct Geometry<'py> {
    #[pyo3(attribute)]
    fruits: Fruits<'py>,
    #[pyo3(attribute)]
    limbs: Limbs<'py>,
    #[pyo3(attribute)]
    leaves: Leaves<'py>,
}

/// `Weather` of the face.
#[derive(FromPyObject)]
pub struct Light {
    #[pyo3(attribute)]
    sun_elevation_rad: f32,
    #[pyo3(attribute)]
    sun_azimuth_rad: f32,
    #[pyo3(attribute)]
    sun_strength: f32,
    #[pyo3(attribute)]
    sun_colour: [f32; 3],
    #[pyo3(attribute)]
    sky_colour: [f32; 3],
    #[pyo3(attribute)]
    horizon_colour: [f32; 3],
    #[pyo3(attribute)]
    wind_m: f32,
}

impl Light {
    fn to_weather(&self) -> Weather {
        let (up, out) = self.sun_elevation_rad.sin_cos();
        let (y, x) = self.sun_azimuth_rad.sin_cos();
        Weather {
            to_sun: Vec3::new(out * x, out * y, up),
            sun_strength: self.sun_strength,
            sun_colour: self.sun_colour.into(),
            sky_colour: self.sky_colour.into(),
            horizon_colour: self.horizon_colour.into(),
            wind_m: self.wind_m,
        }
    }
}

/// The scene and the camera that looks at it.
#[pyclass(module = "pomona._core", name = "RowScene", frozen)]
pub struct PyRowScene {
    scene: Scene,
    camera: Camera,
}

type PairArrays<'py> =
    (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray3<f32>>, Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<u16>>);

#[pymethods]
impl PyRowScene {
    /// Builds shapes and light for all poses that will be asked for.
    #[new]
    #[pyo3(signature = (geometry, camera, session_from_camera, weather, *, seed))]
    #[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
    fn new(
        py: Python<'_>,
        geometry: Geometry<'_>,
        camera: Calibration,
        session_from_camera: PyReadonlyArray3<'_, f64>,
        weather: Light,
        seed: u32,
    ) -> PyResult<Self> {
        let camera = camera.to_stereo_camera()?;
        require_size(&camera)?;
        let views = poses("session_from_camera", &session_from_camera, Pose::from_matrix)?;
        let places: Vec<_> = views.iter().map(|view| view.translation.map(|x| x as f32)).collect();
        let row = Row {
            fruits: fruits(&geometry.fruits)?,
            limbs: limbs(&geometry.limbs)?,
            leaves: leaves(&geometry.leaves)?,
        };
        let weather = weather.to_weather();
        let scene = detached(py, || Scene::new(row, &camera, &places, weather, seed))?;
        Ok(Self { scene, camera })
    }

    /// Left and right (H, W, 3), depth (H, W) and ids (H, W) of one pose.
    #[expect(clippy::needless_pass_by_value, reason = "arguments arrive by value from Python")]
    fn pair<'py>(
        &self,
        py: Python<'py>,
        session_from_camera: PyReadonlyArray2<'py, f64>,
        frame: u32,
    ) -> PyResult<PairArrays<'py>> {
        let pose = pose("session_from_camera", &session_from_camera, Pose::from_matrix)?;
        let pair = detached(py, || self.scene.pair(&self.camera, &pose, frame))?;
        let [height, width] = [self.camera.height, self.camera.width];
        Ok((
            PyArray1::from_vec(py, pair.left).reshape([height, width, 3])?,
            PyArray1::from_vec(py, pair.right).reshape([height, width, 3])?,
            PyArray1::from_vec(py, pair.depth_m).reshape([height, width])?,
            PyArray1::from_vec(py, pair.ids).reshape([height, width])?,
        ))
    }
}

fn require_size(&Camera { width, height, .. }: &Camera) -> PyResult<()> {
    if (1..=MOST_PIXELS).contains(&width.saturating_mul(height)) {
        return Ok(());
    }
    let found = format!("camera: found {width}x{height}, expected 1 to {MOST_PIXELS} pixels");
    Err(PyValueError::new_err(found))
}

/// Rows of an (N, 3) array, finite.
fn vectors(name: &str, rows: &Vectors<'_>, count: usize) -> PyResult<Vec<Vec3>> {
    if rows.shape() != [count, 3] {
        let found = rows.shape();
        return Err(PyValueError::new_err(format!("{name}: found an array of shape {found:?}, expected ({count}, 3)")));
    }
    let read = rows.as_array().axis_iter(Axis(0)).map(|row| Vec3::from_fn(|axis, _| row[axis] as f32)).collect();
    finite(name, read, |vector: &Vec3| vector.iter().all(|x| x.is_finite()))
}

/// An (N,) array, finite.
fn numbers(name: &str, all: &Numbers<'_>, count: usize) -> PyResult<Vec<f32>> {
    if all.len() != count {
        return Err(PyValueError::new_err(format!("{name}: found {} numbers, expected {count}", all.len())));
    }
    finite(name, all.as_array().iter().map(|&x| x as f32).collect(), |x: &f32| x.is_finite())
}

fn finite<T>(name: &str, all: Vec<T>, is_finite: impl Fn(&T) -> bool) -> PyResult<Vec<T>> {
    if all.iter().all(is_finite) {
        return Ok(all);
    }
    Err(PyValueError::new_err(format!("{name}: found a number that is not finite")))
}

fn fruits(all: &Fruits<'_>) -> PyResult<Vec<Fruit>> {
    let ids: Result<Vec<_>, _> = all.ids.as_array().iter().map(|&id| u16::try_from(id)).collect();
    let ids = ids.map_err(|_| PyValueError::new_err("ids: found one outside 0 to 65535"))?;
    let count = ids.len();
    let centres = vectors("centres_m", &all.centres_m, count)?;
    let (diameters, heights) =
        (numbers("diameters_m", &all.diameters_m, count)?, numbers("heights_m", &all.heights_m, count)?);
    let axes = vectors("axes", &all.axes, count)?;
    let grounds = vectors("ground_colours", &all.ground_colours, count)?;
    let blushes = vectors("blush_colours", &all.blush_colours, count)?;
    let shares = numbers("blush_shares", &all.blush_shares, count)?;
    let directions = vectors("blush_directions", &all.blush_directions, count)?;
    let fruit = |at: usize| Fruit {
        id: ids[at],
        centre: centres[at],
        diameter_m: diameters[at],
        height_m: heights[at],
        axis: axes[at],
        ground_colour: grounds[at],
        blush_colour: blushes[at],
        blush_share: shares[at],
        blush_direction: directions[at],
    };
    Ok((0..count).map(fruit).collect())
}

fn limbs(all: &Limbs<'_>) -> PyResult<Vec<Limb>> {
    let count = all.starts_m.shape()[0];
    let (starts, ends) = (vectors("starts_m", &all.starts_m, count)?, vectors("ends_m", &all.ends_m, count)?);
    let start_radii = numbers("start_radii_m", &all.start_radii_m, count)?;
    let end_radii = numbers("end_radii_m", &all.end_radii_m, count)?;
    let colours = vectors("colours", &all.colours, count)?;
    let limb = |at: usize| Limb {
        start: starts[at],
        end: ends[at],
        start_radius_m: start_radii[at],
        end_radius_m: end_radii[at],
        colour: colours[at],
    };
    Ok((0..count).map(limb).collect())
}

fn leaves(all: &Leaves<'_>) -> PyResult<Vec<Leaf>> {
    let count = all.bases_m.shape()[0];
    let (bases, tips) = (vectors("bases_m", &all.bases_m, count)?, vectors("tips", &all.tips, count)?);
    let normals = vectors("normals", &all.normals, count)?;
    let (lengths, widths) = (numbers("lengths_m", &all.lengths_m, count)?, numbers("widths_m", &all.widths_m, count)?);
    let (folds, bends) = (numbers("folds_rad", &all.folds_rad, count)?, numbers("bends_rad", &all.bends_rad, count)?);
    let colours = vectors("colours", &all.colours, count)?;
    let leaf = |at: usize| Leaf {
        base: bases[at],
        tip: tips[at],
        normal: normals[at],
        length_m: lengths[at],
        width_m: widths[at],
        fold_rad: folds[at],
        bend_rad: bends[at],
        colour: colours[at],
    };
    Ok((0..count).map(leaf).collect())
}
