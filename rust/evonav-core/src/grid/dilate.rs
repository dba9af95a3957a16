//! Dilation of cells by a disk.

use crate::grid::bits::BitGrid;

/// Largest radius of [`dilate_disk`], in cells.
pub const MAX_RADIUS: usize = 64;

/// Dilate the set cells by a disk: set the cells whose centre is within `radius` cells of a set
/// one, as scikit-image's `disk(radius)`.
///
/// Each row is widened one cell at a time; each width is added to the rows in which the disk has
/// that width.
///
/// # Arguments
/// * `radius` - in cells, at most [`MAX_RADIUS`] (larger values are reduced to it).
///
/// # Complexity
/// O(words * radius); rows without a set cell cost nothing.
///
/// # Examples
/// ```
/// # use evonav_core::grid::{bits::BitGrid, dilate::dilate_disk};
/// let mut cells = BitGrid::new(5, 5);
/// cells.insert(2, 2);
/// assert_eq!(dilate_disk(&cells, 1).count(), 5);
/// assert_eq!(dilate_disk(&cells, 2).count(), 13);
/// ```
pub fn dilate_disk(cells: &BitGrid, radius: usize) -> BitGrid {
    let radius = radius.min(MAX_RADIUS);
    let mut dilated = BitGrid::new(cells.rows(), cells.cols());
    let stride = cells.row(0).len();
    let last_mask = if stride == 0 { 0 } else { cells.word_mask(stride - 1) };
    // Half the width of the disk, `dy` rows from its middle.
    let half_width =
        |dy: usize| (0..=radius).rev().find(|w| w * w + dy * dy <= radius * radius).unwrap_or(0);
    let half_widths: Vec<usize> = (0..=radius).map(half_width).collect();
    let mut wide = vec![0_u64; stride];
    for row in 0..cells.rows() {
        if cells.row(row).iter().all(|&word| word == 0) {
            continue;
        }
        wide.copy_from_slice(cells.row(row));
        for width in 0..=radius {
            if width > 0 {
                widen(&mut wide, last_mask);
            }
            for dy in (0..=radius).filter(|&dy| half_widths[dy] == width) {
                let above = row.checked_sub(dy);
                let below = (row + dy < cells.rows() && dy > 0).then_some(row + dy);
                for target in above.into_iter().chain(below) {
                    let row_words = dilated.row_mut(target);
                    row_words.iter_mut().zip(&wide).for_each(|(word, add)| *word |= add);
                }
            }
        }
    }
    dilated
}

/// Add the left and right neighbours of the set bits of a row.
fn widen(words: &mut [u64], last_mask: u64) {
    let mut carry = 0;
    for index in 0..words.len() {
        let word = words[index];
        let next = words.get(index + 1).copied().unwrap_or(0);
        words[index] = word | word << 1 | carry | word >> 1 | next << 63;
        carry = word >> 63;
    }
    if let Some(last) = words.last_mut() {
        *last &= last_mask;
    }
}
