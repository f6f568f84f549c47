//! Numbers in a row, in memory of their own or in bytes that someone else holds.

use bytemuck::Pod;
use std::ops::Range;
use std::sync::Arc;

/// Bytes that stay as long as someone holds them: read, or mapped.
pub type Bytes = Arc<dyn AsRef<[u8]> + Send + Sync>;

/// The same bytes where numbers can be read from them: their own, or a copy.
pub(super) fn aligned(bytes: &Bytes) -> Bytes {
    let content = bytes.as_ref().as_ref();
    if bytemuck::try_cast_slice::<u8, Widest>(&content[..content.len() / WIDEST * WIDEST]).is_ok() {
        return Arc::clone(bytes);
    }
    let mut words = vec![Widest::default(); content.len().div_ceil(WIDEST)];
    bytemuck::cast_slice_mut(&mut words)[..content.len()].copy_from_slice(content);
    Arc::new(Words { words, length: content.len() })
}

/// The widest number of a column.
type Widest = u64;
const WIDEST: usize = size_of::<Widest>();

/// So many bytes of words.
struct Words {
    words: Vec<Widest>,
    length: usize,
}

impl AsRef<[u8]> for Words {
    fn as_ref(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.length]
    }
}

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
