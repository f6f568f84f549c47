//! The index of a large map as bytes: a header of numbers, then the columns as they lie in memory.
//!
//! The header has a sum of its own and one over all columns, and names the map by a sum over its places. Opening reads
//! everything once to compare the sums. Both are no proof against someone who makes a file on purpose: so the lengths of
//! columns must agree, and no number out of a column is trusted as a row.

use super::columns::{Bytes, Column, aligned};
use super::ground::n_buckets;
use super::seed_blocks::LANES;
use super::{CompactMap, Facts, MOST};
use crate::cloud::FruitCloud;
use crate::error::{Error, Result};
use crate::neighbours::code_grid::{Axis, Cells};
use crate::verified::seeds::COMPANIONS;
use nalgebra::Vector3;
use rayon::prelude::*;

/// On a machine with another order of bytes it reads otherwise.
const MAGIC: u64 = u64::from_le_bytes(*b"POMONAix");
const VERSION: u64 = 2;

/// Words of 64 bits in the header; its own sum is the last.
const HEADER: usize = 64;

/// Columns start at multiples of this, bytes.
const ALIGNED: usize = 64;

const COLUMNS: usize = 8;

/// Bytes that are summed in one piece.
const PIECE: usize = 1 << 20;

impl CompactMap {
    /// The index as pieces of a file, in order.
    pub(crate) fn pieces(&self) -> impl Iterator<Item = Vec<u8>> + '_ {
        let columns = self.columns();
        let lengths = columns.map(<[u8]>::len);
        let sum = sum_of_all(&columns);
        let header = self.facts.header(lengths, sum);
        let body = columns.into_iter().flat_map(|column| {
            let padding = vec![0; column.len().next_multiple_of(ALIGNED) - column.len()];
            column.chunks(PIECE).map(<[u8]>::to_vec).chain([padding])
        });
        std::iter::once(bytemuck::cast_slice(&header).to_vec()).chain(body)
    }

    /// The index that bytes hold, if it is one of this map.
    ///
    /// # Errors
    /// Another map or version, or bytes that are not as they were written.
    pub(crate) fn opened(bytes: &Bytes, map: &FruitCloud) -> Result<Self> {
        let bytes = &aligned(bytes);
        let content = bytes.as_ref().as_ref();
        let header = header_of(content)?;
        let (facts, lengths, sum) = Facts::read(&header)?;
        if (facts.given, facts.fingerprint) != (map.len(), fingerprint(map)) {
            return wrong("made from another map, or the map has changed since");
        }
        let index = Self::over(facts, bytes, content.len(), lengths)?;
        if sum_of_all(&index.columns()) != sum || !is_padded_by_nothing(content, &lengths) || !index.is_sound() {
            return wrong("the file is damaged: its checksum is not that of its content");
        }
        Ok(index)
    }

    fn columns(&self) -> [&[u8]; COLUMNS] {
        [
            self.rows.bytes(),
            self.points.bytes(),
            self.buckets.bytes(),
            self.companions.bytes(),
            self.surroundings.bytes(),
            self.starts.bytes(),
            self.common.bytes(),
            self.seeds.bytes(),
        ]
    }

    fn over(facts: Facts, bytes: &Bytes, length: usize, lengths: [usize; COLUMNS]) -> Result<Self> {
        let mut end = HEADER * 8;
        let mut ranges = lengths.into_iter().map(|length| {
            let first = end;
            end = first.saturating_add(length.checked_next_multiple_of(ALIGNED).unwrap_or(usize::MAX));
            first..first.saturating_add(length)
        });
        let mut next = || ranges.next().unwrap_or_default();
        let index = Self {
            facts,
            rows: Column::Held(bytes.clone(), next()),
            points: Column::Held(bytes.clone(), next()),
            buckets: Column::Held(bytes.clone(), next()),
            companions: Column::Held(bytes.clone(), next()),
            surroundings: Column::Held(bytes.clone(), next()),
            starts: Column::Held(bytes.clone(), next()),
            common: Column::Held(bytes.clone(), next()),
            seeds: Column::Held(bytes.clone(), next()),
        };
        drop(ranges);
        if end == length { Ok(index) } else { wrong(&format!("found {length} bytes, expected {end}")) }
    }

    /// Whether the columns belong to each other.
    fn is_sound(&self) -> bool {
        let (fruits, cells) = (self.rows.get().len(), self.facts.cells.len());
        let starts = self.starts.get();
        fruits <= MOST.min(self.facts.given)
            && self.rows.get().iter().all(|&row| (row as usize) < self.facts.given)
            && self.points.get().len() == fruits
            && self.surroundings.get().len() == fruits
            && self.buckets.get().len() == n_buckets(fruits) + 1
            && self.companions.get().len() == fruits * self.facts.each
            && starts.len() == cells + 1
            && starts.is_sorted()
            && self.seeds.get().len() == (starts[cells] as usize).div_ceil(LANES)
            && self.common.get().len() == cells.div_ceil(32)
    }
}

/// Whether the bytes between the columns, which no sum holds, are zero; the lengths are those of `content`.
fn is_padded_by_nothing(content: &[u8], lengths: &[usize; COLUMNS]) -> bool {
    let mut end = HEADER * 8;
    lengths.iter().all(|length| {
        let padding = end + length..end + length.next_multiple_of(ALIGNED);
        end = padding.end;
        content[padding].iter().all(|&byte| byte == 0)
    })
}

fn wrong<T>(reason: &str) -> Result<T> {
    Err(Error::Index { reason: reason.to_owned() })
}

fn header_of(content: &[u8]) -> Result<[u64; HEADER]> {
    let mut header = [0u64; HEADER];
    let Some(bytes) = content.get(..HEADER * 8) else {
        return wrong(&format!("found {} bytes, expected an index of {} and more", content.len(), HEADER * 8));
    };
    bytemuck::cast_slice_mut(&mut header).copy_from_slice(bytes);
    if header[0] != MAGIC {
        return wrong("this is no index");
    }
    if header[1] != VERSION {
        return wrong(&format!("found version {} of the format, expected {VERSION}", header[1]));
    }
    if header[HEADER - 1] != sum_of(&bytes[..(HEADER - 1) * 8]) {
        return wrong("the file is damaged: the checksum of its header is wrong");
    }
    Ok(header)
}

impl Facts {
    fn header(&self, lengths: [usize; COLUMNS], sum: u64) -> [u64; HEADER] {
        let numbers = [self.sampled_spacing, self.spacing, self.step, f64::from(self.cells.edge)];
        let axes = self
            .cells
            .axes
            .iter()
            .flat_map(|axis| [axis.number as u64, f64::from(axis.low).to_bits(), u64::from(axis.cells)]);
        let words = [MAGIC, VERSION, self.given as u64, self.fingerprint, self.each as u64, sum]
            .into_iter()
            .chain(self.middle.iter().chain(&numbers).map(|number| number.to_bits()))
            .chain(axes)
            .chain(lengths.map(|length| length as u64));
        let mut header = [0; HEADER];
        header.iter_mut().zip(words).for_each(|(slot, word)| *slot = word);
        header[HEADER - 1] = sum_of(bytemuck::cast_slice(&header[..HEADER - 1]));
        header
    }

    /// The reverse of [`Facts::header`], and the lengths and the sum of the columns.
    fn read(header: &[u64; HEADER]) -> Result<(Self, [usize; COLUMNS], u64)> {
        let mut words = header[2..].iter().copied();
        let mut word = || words.next().unwrap_or_default();
        let (given, fingerprint, each, sum) = (word() as usize, word(), word() as usize, word());
        let mut number = || f64::from_bits(word());
        let middle = Vector3::from_fn(|_, _| number());
        let [sampled_spacing, spacing, step, edge] = std::array::from_fn(|_| number());
        let axes = std::array::from_fn(|_| Axis {
            number: word() as usize,
            low: f64::from_bits(word()) as f32,
            cells: word() as u32,
        });
        let cells = Cells { axes, edge: edge as f32 };
        let lengths = std::array::from_fn(|_| word() as usize);
        let lengths_of_space = [sampled_spacing, spacing, step, edge];
        let is_sound = middle.iter().all(|x: &f64| x.is_finite())
            && lengths_of_space.iter().all(|x| x.is_finite() && *x > 0.0)
            && each <= COMPANIONS
            && cells.is_sound();
        if !is_sound {
            return wrong("the file is damaged: its header has numbers that cannot be");
        }
        Ok((Self { given, fingerprint, middle, sampled_spacing, spacing, step, each, cells }, lengths, sum))
    }
}

/// A sum over the places of a cloud, in the order of its rows.
pub(crate) fn fingerprint(cloud: &FruitCloud) -> u64 {
    let words = cloud.positions.iter().flat_map(|p| [p.x, p.y, p.z]).map(f64::to_bits);
    words.fold(cloud.len() as u64, mixed)
}

fn sum_of_all(columns: &[&[u8]; COLUMNS]) -> u64 {
    let sums: Vec<u64> =
        columns.iter().flat_map(|column| column.par_chunks(PIECE).map(sum_of).collect::<Vec<_>>()).collect();
    sums.into_iter().fold(0, mixed)
}

/// A change of one word changes it for certain: every step can be undone.
fn sum_of(bytes: &[u8]) -> u64 {
    const AT_ONCE: usize = 8;
    let (whole, rest) = bytes.split_at(bytes.len() / (8 * AT_ONCE) * 8 * AT_ONCE);
    let word = |bytes: &[u8]| {
        let mut word = [0; 8];
        word[..bytes.len()].copy_from_slice(bytes);
        u64::from_le_bytes(word)
    };
    let mut sums = [bytes.len() as u64; AT_ONCE];
    for words in whole.chunks_exact(8 * AT_ONCE) {
        for (sum, bytes) in sums.iter_mut().zip(words.chunks_exact(8)) {
            *sum = (*sum ^ word(bytes)).wrapping_mul(ODD);
        }
    }
    rest.chunks(8).map(word).chain(sums).fold(0, mixed)
}

#[inline]
fn mixed(sum: u64, word: u64) -> u64 {
    (sum.rotate_left(29) ^ word).wrapping_mul(ODD)
}

const ODD: u64 = 0x9E37_79B9_7F4A_7C15;
