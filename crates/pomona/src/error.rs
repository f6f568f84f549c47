//! What can be wrong with the input of the core. "No match" is not here: it is a verdict of the match.

use std::fmt;

/// Wrong input, named so that one line tells what to correct.
#[derive(Debug, Clone, PartialEq)]
pub enum Error {
    /// A number is NaN or infinite.
    NotFinite {
        /// Which array.
        what: &'static str,
        /// Zero-based row in it.
        row: usize,
    },
    /// An array has another number of rows than what it belongs to.
    Length {
        /// Which array.
        what: &'static str,
        /// Rows found.
        found: usize,
        /// Rows expected.
        expected: usize,
    },
    /// A number names a row that does not exist.
    Row {
        /// Which array the number stands in.
        what: &'static str,
        /// The row that it names.
        found: usize,
        /// Rows there are.
        below: usize,
    },
    /// A covariance is not symmetric positive semi-definite.
    Covariance {
        /// Zero-based row of the fruit.
        row: usize,
    },
    /// A diameter that is no length; one that is not known is NaN.
    Diameter {
        /// Zero-based row of the fruit.
        row: usize,
        /// The diameter, metres.
        found: f64,
    },
    /// A fruit that was never seen, or whose sightings have a covariance that is not positive definite or a diameter that is no length.
    Unplaced {
        /// Zero-based row of the fruit.
        fruit: usize,
    },
    /// More fruits in one cloud than the verified method holds.
    TooManyFruits {
        /// Fruits found.
        found: usize,
        /// Fruits at most.
        most: usize,
    },
    /// An index that was kept cannot be used with this map.
    Index {
        /// What was found and what was expected.
        reason: String,
    },
    /// The settings make more constellations of the fruits than memory should hold.
    TooManyConstellations {
        /// Whose fruits: the map's or the query's.
        whose: &'static str,
        /// Fruits of that cloud.
        fruits: usize,
        /// Constellations that they give.
        found: usize,
        /// Constellations at most.
        most: usize,
    },
    /// A setting lies outside its range.
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// What was found and what was expected.
        reason: String,
    },
    /// What the caller says of one pair of clouds cannot be, or not with this method or index.
    Request {
        /// Name of the argument.
        name: &'static str,
        /// What was found and what was expected.
        reason: String,
    },
    /// A matrix is no similarity transform.
    Similarity {
        /// What was found and what was expected.
        reason: &'static str,
    },
    /// A pose of the camera is no rigid transform.
    Pose,
    /// Frames do not come in order.
    FrameOrder {
        /// Number of the frame.
        found: i64,
        /// Number of the frame before.
        last: i64,
    },
}

/// Result of the core's fallible functions.
pub type Result<T> = std::result::Result<T, Error>;

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite { what, row } => {
                write!(f, "{what}: row {row} is NaN or infinite, expected finite numbers")
            }
            Self::Length { what, found, expected } => write!(f, "{what}: found {found} rows, expected {expected}"),
            Self::Row { what, found, below } => write!(f, "{what}: found row {found}, expected one below {below}"),
            Self::Covariance { row } => {
                write!(f, "covariances: row {row} is not symmetric positive semi-definite")
            }
            Self::Diameter { row, found } => {
                write!(
                    f,
                    "diameters_m: row {row} is {found}, expected a length above 0 m, or NaN where it is not known"
                )
            }
            Self::Unplaced { fruit } => {
                write!(f, "fruit {fruit}: expected at least one sighting, each with a positive definite covariance")
            }
            Self::TooManyFruits { found, most } => {
                write!(f, "found {found} fruits in one cloud, the verified method expects at most {most}")
            }
            Self::Index { reason } => write!(f, "{reason}"),
            Self::TooManyConstellations { whose, fruits, found, most } => write!(
                f,
                "constellation.n: the {fruits} fruits of the {whose} give up to {found} constellations, \
                 expected at most {most}"
            ),
            Self::Setting { name, reason } => write!(f, "setting {name}: {reason}"),
            Self::Request { name, reason } => write!(f, "{name}: {reason}"),
            Self::Similarity { reason } => write!(f, "map_from_query: {reason}"),
            Self::Pose => {
                write!(f, "session_from_camera: found a matrix that does not turn and move, expected a rigid one")
            }
            Self::FrameOrder { found, last } => {
                write!(f, "frame {found}: found after frame {last}, expected a larger number")
            }
        }
    }
}

impl std::error::Error for Error {}
