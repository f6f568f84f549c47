//! What can be wrong with the input of the core. "No match" is not here: it is a verdict of the match.

use std::fmt;

/// Wrong input, named so that one line tells what to correct.
#[derive(Debug, Clone, PartialEq)]
pub enum Error {
    /// A coordinate is NaN or infinite.
    NotFinite {
        /// Zero-based row of the fruit.
        row: usize,
    },
    /// An array has another number of rows than there are fruits.
    Length {
        /// Which array.
        what: &'static str,
        /// Rows found.
        found: usize,
        /// Rows expected.
        expected: usize,
    },
    /// A covariance is not symmetric positive semi-definite.
    Covariance {
        /// Zero-based row of the fruit.
        row: usize,
    },
    /// A setting lies outside its range.
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// What was found and what was expected.
        reason: String,
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
            Self::NotFinite { row } => write!(f, "row {row}: a coordinate is NaN or infinite, expected finite metres"),
            Self::Length { what, found, expected } => {
                write!(f, "{what}: found {found} rows, expected {expected}, one per fruit")
            }
            Self::Covariance { row } => {
                write!(f, "row {row}: covariance is not symmetric positive semi-definite")
            }
            Self::Pose => {
                write!(f, "session_from_camera: found a matrix that does not turn and move, expected a rigid one")
            }
            Self::FrameOrder { found, last } => {
                write!(f, "frame {found}: found after frame {last}, expected a larger number")
            }
            Self::Setting { name, reason } => write!(f, "setting {name}: {reason}"),
        }
    }
}

impl std::error::Error for Error {}
