//! Thin point clouds.

use crate::{memory::objects::clouds::point_blocks::PointBlocks, sensors::unproject::Point};

/// Reduce points to one per voxel, the mean of the points inside, in the order of the voxels' first
/// points. This is Open3D's `voxel_down_sample` with voxels aligned to the world instead of the
/// cloud.
pub fn voxel_filter(points: &[Point], edge_m: f64) -> Vec<Point> {
    one_a_voxel(points, edge_m).0
}

/// Return the same as [`voxel_filter`], and its points by block: rounding takes no mean out of its
/// voxel.
pub(crate) fn one_a_voxel(points: &[Point], edge_m: f64) -> (Vec<Point>, PointBlocks) {
    const IS_SUM: u32 = 1 << 31;
    let PointBlocks { blocks, spots } = PointBlocks::new(points, 1.0 / edge_m);
    let num_voxels: u32 = blocks.iter().map(|(_, bits)| bits.count_ones()).sum();
    if num_voxels as usize == points.len() {
        return (points.to_vec(), PointBlocks { blocks, spots });
    }
    // Of the points met so far in each voxel: 0 without points, one more than the number of the
    // average that is a single point, or the number of the sum of several.
    let mut numbers = vec![[0_u32; 64]; blocks.len()];
    let mut averages: Vec<Point> = Vec::with_capacity(num_voxels as usize);
    let mut spots_of_averages = Vec::with_capacity(num_voxels as usize);
    // Sum and number of points, and number of the average.
    let mut sums: Vec<([f64; 3], f64, u32)> = Vec::new();
    for (&point, &spot) in points.iter().zip(&spots) {
        let number = &mut numbers[spot.block()][spot.place()];
        if *number == 0 {
            averages.push(point);
            spots_of_averages.push(spot);
            *number = averages.len() as u32;
            continue;
        }
        if *number & IS_SUM == 0 {
            let average = *number - 1;
            *number = IS_SUM | sums.len() as u32;
            sums.push((averages[average as usize].map(f64::from), 1.0, average));
        }
        let (sum, count, _) = &mut sums[(*number & !IS_SUM) as usize];
        for (sum, value) in sum.iter_mut().zip(point) {
            *sum += f64::from(value);
        }
        *count += 1.0;
    }
    for (sum, count, average) in sums {
        averages[average as usize] = sum.map(|value| (value / count) as f32);
    }
    (averages, PointBlocks { blocks, spots: spots_of_averages })
}
