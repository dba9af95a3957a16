//! Join the network's cells to instances, and find the instances' pixels in the image.

use crate::{
    Error,
    grid::components::find,
    perception::mini::{
        convolution::Tensor,
        network::{SIDE_CELLS, samples},
    },
};

/// Smallest logit of a link that joins cells. With 0, and without [`MIN_AGREEMENT`], many objects
/// would be joined with their support: F1 on validation houses was 0.33 instead of 0.38.
pub const MIN_LINK: f32 = 1.0;
/// Smallest cosine between the class probabilities of linked cells.
pub const MIN_AGREEMENT: f32 = 0.8;

/// The instances in the grid of cells.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Segments {
    /// Instance of each cell, row-major; -1 if none.
    pub cells: Vec<i32>,
    /// Class of each instance.
    pub classes: Vec<usize>,
    /// Mean probability of the class over the instance's cells.
    pub confidences: Vec<f32>,
}

/// Join neighbouring cells that the network links into instances, and let each instance's cells
/// vote for its class.
///
/// A cell is part of an object if a class is more likely there than the background. Two such
/// neighbours are joined if the link between them is strong enough ([`MIN_LINK`]) and their classes
/// are similar ([`MIN_AGREEMENT`]).
///
/// # Arguments
/// * `logits` - background, classes, link to the right and link downwards of each cell.
/// * `min_cells` - instances with fewer cells are dropped.
/// * `min_confidence` - instances with a smaller confidence are dropped.
///
/// # Errors
/// [`Error::InvalidArgument`] if a cell has no class, or a threshold is not a number.
///
/// # Complexity
/// O(cells x classes).
pub fn segments(logits: &Tensor, min_cells: usize, min_confidence: f32) -> Result<Segments, Error> {
    Error::require("logits", logits.channels, "at least 4 a cell", |channels| channels >= 4)?;
    Error::require("min_confidence", min_confidence, "in 0..=1", |v| (0.0..=1.0).contains(&v))?;
    let (width, num_classes) = (logits.width, logits.channels - 3);
    let cells: Vec<&[f32]> = logits.values.chunks_exact(logits.channels).collect();
    let is_object: Vec<bool> =
        cells.iter().map(|cell| cell[1..=num_classes].iter().any(|&v| v > cell[0])).collect();
    let shares: Vec<Vec<f32>> = cells
        .iter()
        .zip(&is_object)
        .map(|(cell, &is_object)| if is_object { shares(&cell[..=num_classes]) } else { vec![] })
        .collect();
    let mut parents: Vec<u32> = (0..cells.len() as u32).collect();
    for (place, cell) in cells.iter().enumerate().filter(|(place, _)| is_object[*place]) {
        let right = (place % width + 1 < width).then_some(place + 1);
        let links = [(right, cell[num_classes + 1]), (Some(place + width), cell[num_classes + 2])];
        for (other, link) in links {
            if let Some(other) = other.filter(|&other| is_object.get(other) == Some(&true))
                && link > MIN_LINK
                && agree(&shares[place], &shares[other])
            {
                let [a, b] = [place, other].map(|cell| find(&mut parents, cell as u32));
                parents[a.max(b) as usize] = a.min(b);
            }
        }
    }
    // Instances are numbered in the order of their first cell.
    let mut number_of = vec![usize::MAX; cells.len()];
    let mut votes: Vec<(usize, Vec<f32>)> = Vec::new();
    let mut found = vec![usize::MAX; cells.len()];
    for place in (0..cells.len()).filter(|&place| is_object[place]) {
        let root = find(&mut parents, place as u32) as usize;
        if number_of[root] == usize::MAX {
            number_of[root] = votes.len();
            votes.push((0, vec![0.0; num_classes]));
        }
        found[place] = number_of[root];
        let (num_cells, sums) = &mut votes[number_of[root]];
        *num_cells += 1;
        for (sum, share) in sums.iter_mut().zip(&shares[place]) {
            *sum += share;
        }
    }
    let mut segments = Segments::default();
    let numbers: Vec<i32> = votes
        .iter()
        .map(|(num_cells, sums)| {
            let class = largest(sums);
            let confidence = (sums[class] / *num_cells as f32).clamp(0.0, 1.0);
            if *num_cells < min_cells || confidence.is_nan() || confidence < min_confidence {
                return -1;
            }
            segments.classes.push(class);
            segments.confidences.push(confidence);
            segments.classes.len() as i32 - 1
        })
        .collect();
    segments.cells =
        found.iter().map(|&number| numbers.get(number).copied().unwrap_or(-1)).collect();
    Ok(segments)
}

/// Return the softmax of the classes; the background, which comes first, is left out.
fn shares(logits: &[f32]) -> Vec<f32> {
    let most = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let powers: Vec<f32> = logits.iter().map(|logit| (logit - most).exp()).collect();
    let total: f32 = powers.iter().sum();
    powers[1..].iter().map(|power| power / total).collect()
}

/// Return whether the class probabilities of two cells are similar.
fn agree(a: &[f32], b: &[f32]) -> bool {
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
    dot(a, b) > MIN_AGREEMENT * (dot(a, a) * dot(b, b)).sqrt()
}

/// Return the index of the largest number, the first of equals.
fn largest(values: &[f32]) -> usize {
    let mut best = 0;
    for (index, value) in values.iter().enumerate() {
        if *value > values[best] {
            best = index;
        }
    }
    best
}

/// Weights of the differences between a pixel and a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resemblance {
    /// Weight of a difference of one in one colour channel.
    pub colour: f32,
    /// Weight of one depth being twice the other.
    pub depth: f32,
    /// Weight of a distance of one cell's width.
    pub place: f32,
}

impl Default for Resemblance {
    fn default() -> Self {
        Self { colour: 0.02, depth: 8.0, place: 0.5 }
    }
}

/// Assign every pixel to the instance of the most similar cell around it, so that outlines follow
/// those of the image.
///
/// # Arguments
/// * `cells` - instance of each cell of the network's grid.
/// * `rgb`, `depth_m`, `size_px` - the image, as for [`crate::perception::mini::network::input`].
/// * `weigh` - weights of the differences.
///
/// # Returns
/// Instance of each pixel, -1 if none.
///
/// # Errors
/// [`Error::InvalidArgument`] if the numbers of cells or pixels do not agree.
///
/// # Complexity
/// O(pixels), with nine comparisons per pixel where the cells around differ.
pub fn refine(
    cells: &[i32],
    rgb: &[u8],
    depth_m: &[f32],
    size_px: [usize; 2],
    weigh: Resemblance,
) -> Result<Vec<i32>, Error> {
    let [width, height] = size_px;
    Error::require("cells", cells.len(), "one a cell", |len| len == SIDE_CELLS * SIDE_CELLS)?;
    let num_px = width.checked_mul(height).unwrap_or(0);
    let fits = num_px > 0 && depth_m.len() == num_px && rgb.len() == 3 * num_px;
    Error::require("rgb", rgb.len(), "three bytes, and a depth, a pixel", |_| fits)?;
    let (pixels, [rows, cols]) = (rgb.as_chunks::<3>().0, [height, width].map(samples));
    let guide = |place: usize| Guide { rgb: pixels[place].map(f32::from), z_m: depth_m[place] };
    let guides: Vec<Guide> = (0..SIDE_CELLS * SIDE_CELLS)
        .map(|cell| guide(rows[cell / SIDE_CELLS * 2] * width + cols[cell % SIDE_CELLS * 2]))
        .collect();
    let mut found = Vec::with_capacity(num_px);
    let col_cells: Vec<usize> = (0..width).map(|col| col * SIDE_CELLS / width).collect();
    for row in 0..height {
        let near_rows = around(row * SIDE_CELLS / height);
        let mut last = (usize::MAX, None);
        for (col, &col_cell) in col_cells.iter().enumerate() {
            if last.0 != col_cell {
                last = (col_cell, same_around(cells, near_rows.clone(), around(col_cell)));
            }
            if let Some(instance) = last.1 {
                found.push(instance);
                continue;
            }
            let pixel = guide(row * width + col);
            let mut best = (f32::INFINITY, -1);
            for cell_row in near_rows.clone() {
                let down = (row as f32 - rows[2 * cell_row] as f32) * SIDE_CELLS as f32;
                for cell_col in around(col_cell) {
                    let right = (col as f32 - cols[2 * cell_col] as f32) * SIDE_CELLS as f32;
                    let cell = cell_row * SIDE_CELLS + cell_col;
                    let apart =
                        weigh.place * (down.abs() / height as f32 + right.abs() / width as f32);
                    let unlike = apart + pixel.unlike(&guides[cell], weigh);
                    if unlike < best.0 {
                        best = (unlike, cells[cell]);
                    }
                }
            }
            found.push(best.1);
        }
    }
    Ok(found)
}

struct Guide {
    rgb: [f32; 3],
    z_m: f32,
}

impl Guide {
    fn unlike(&self, other: &Self, weigh: Resemblance) -> f32 {
        let colour: f32 = self.rgb.iter().zip(&other.rgb).map(|(a, b)| (a - b).abs()).sum();
        let (a, b) = (self.z_m.clamp(0.05, 20.0), other.z_m.clamp(0.05, 20.0));
        weigh.colour * colour + weigh.depth * ((a - b).abs() / a.min(b)).min(1.0)
    }
}

/// Return the indices of a cell and the ones beside it along one axis.
fn around(place: usize) -> std::ops::Range<usize> {
    place.saturating_sub(1)..(place + 2).min(SIDE_CELLS)
}

/// Return the instance of a block of cells, if all have the same one.
fn same_around(
    cells: &[i32],
    rows: std::ops::Range<usize>,
    cols: std::ops::Range<usize>,
) -> Option<i32> {
    let first = cells[rows.start * SIDE_CELLS + cols.start];
    let mut rows = rows.map(|row| &cells[row * SIDE_CELLS..][cols.clone()]);
    rows.all(|row| row.iter().all(|&instance| instance == first)).then_some(first)
}
