//! Numbers in a row, in memory of their own or in bytes that someone else holds.

use bytemuck::Pod;
use std::ops::Range;
use std::sync::Arc;

/// Bytes that stay as long as someone holds them: read, or mapped.
pub type Bytes = Arc<dyn AsRef<[u8]> + Send + Sync>;

#[derive(Clone)]
pub(super) enum Column<T> {
    Own(Vec<T>),
    Held(Bytes, Range<usize>),
}

impl<T: Pod> Column<T> {
    /// The numbers; none where bytes are not there or not aligned.
    #[inline]
    pub(super) fn get(&self) -> &[T] {
        match self {
            Self::Own(numbers) => numbers,
            Self::Held(bytes, range) => {
                let bytes = bytes.as_ref().as_ref().get(range.clone()).unwrap_or_default();
                bytemuck::try_cast_slice(bytes).unwrap_or_default()
            }
        }
    }

    pub(super) fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(self.get())
    }
}

impl<T> From<Vec<T>> for Column<T> {
    fn from(numbers: Vec<T>) -> Self {
        Self::Own(numbers)
    }
}

impl<T> std::fmt::Debug for Column<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Own(numbers) => write!(f, "{} numbers", numbers.len()),
            Self::Held(_, range) => write!(f, "bytes {range:?}"),
        }
    }
}
