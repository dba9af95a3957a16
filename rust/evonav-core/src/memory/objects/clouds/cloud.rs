//! An object's point cloud, indexed so that new points are matched and merged without a rebuild.

use crate::{
    geometry::Aabb,
    grid::bits::ones,
    memory::objects::clouds::{
        blocks::{Blocks, block_at, cube_of, place},
        point_blocks::{END, PointBlocks, chain},
        voxels::{Voxel, VoxelTable, bounds},
    },
    sensors::unproject::Point,
};

/// Points in order of arrival, at most one per voxel, and what finds the points near a place.
#[derive(Debug, Clone)]
pub struct Cloud {
    pub(super) points: Vec<Point>,
    pub(super) bounds_m: Aabb,
    pub(super) inverse_edge: f64,
    pub(super) radius_m: f32,
    /// Index in `cubes` of each cube of 4 x 4 x 4 blocks with points.
    pub(super) index: VoxelTable,
    pub(super) cubes: Vec<Cube>,
    /// The next point in the same block of each point, which is older.
    pub(super) next: Vec<u32>,
    /// Number of points, the first ones, that are known to be one cluster.
    num_old: usize,
}

/// The blocks of a cube, by their [`place`].
#[derive(Debug, Clone)]
pub(super) struct Cube {
    pub(super) voxel: Voxel,
    /// The blocks with points.
    pub(super) blocks: u64,
    /// The voxels with points of each block.
    pub(super) bits: [u64; 64],
    /// A point of each block; `next` leads to the others.
    pub(super) firsts: [u32; 64],
}

/// No cube has this voxel.
pub(super) const NO_CUBE: Voxel = [i32::MAX; 3];

impl Cloud {
    /// Create a cloud from the first point of each voxel.
    ///
    /// # Arguments
    /// * `voxel_m` - edge length of a voxel.
    /// * `radius_m` - radius within which [`Cloud::overlap`] looks for points.
    pub fn new(points: &[Point], voxel_m: f64, radius_m: f32) -> Self {
        Self::of_blocks(points, &PointBlocks::new(points, 1.0 / voxel_m), voxel_m, radius_m)
    }

    /// Return the same as [`Cloud::new`] for points whose blocks are known.
    pub(crate) fn of_blocks(
        points: &[Point],
        blocks: &PointBlocks,
        voxel_m: f64,
        radius_m: f32,
    ) -> Self {
        let mut cloud = Self {
            points: Vec::with_capacity(points.len()),
            bounds_m: Aabb::EMPTY,
            inverse_edge: 1.0 / voxel_m,
            radius_m,
            index: VoxelTable::with_capacity(blocks.blocks.len() / 8),
            cubes: Vec::new(),
            next: Vec::with_capacity(points.len()),
            num_old: 0,
        };
        cloud.merge_blocks(points, blocks);
        cloud
    }

    /// Return the points, `[x, y, z]`.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Return the smallest box around the points.
    pub fn bounds_m(&self) -> &Aabb {
        &self.bounds_m
    }

    /// Return the number of bytes of the points and of the tables that find them.
    pub(crate) fn num_bytes(&self) -> usize {
        size_of::<Self>()
            + self.points.capacity() * size_of::<Point>()
            + self.next.capacity() * size_of::<u32>()
            + self.cubes.capacity() * size_of::<Cube>()
            + self.index.num_heap_bytes()
    }

    /// Add the points that fall into voxels without a point.
    pub fn merge(&mut self, points: &[Point]) {
        self.merge_blocks(points, &PointBlocks::new(points, self.inverse_edge));
    }

    /// Do the same as [`Cloud::merge`] with points whose blocks are known.
    pub(crate) fn merge_blocks(&mut self, points: &[Point], new: &PointBlocks) {
        // Cube of each new block, and the voxels that are still without a point.
        let mut free: Vec<(u32, u64)> = Vec::with_capacity(new.blocks.len());
        let mut num_free = 0;
        // Most blocks are in the cube of the one before.
        let (mut voxel, mut number) = (NO_CUBE, 0);
        for &(block, bits) in &new.blocks {
            if voxel != cube_of(block) {
                voxel = cube_of(block);
                let (&mut known, is_new) = self.index.entry(voxel, self.cubes.len() as u32);
                number = known;
                if is_new {
                    self.cubes.push(Cube { voxel, blocks: 0, bits: [0; 64], firsts: [END; 64] });
                }
            }
            let cube = &mut self.cubes[number as usize];
            let known = &mut cube.bits[place(block)];
            free.push((number, bits & !*known));
            num_free += (bits & !*known).count_ones();
            *known |= bits;
            cube.blocks |= 1 << place(block);
        }
        if num_free == 0 {
            return;
        }
        let num_before = self.points.len();
        for (&point, spot) in points.iter().zip(&new.spots) {
            let (cube, free) = &mut free[spot.block()];
            if *free & spot.bit() != 0 {
                *free ^= spot.bit();
                let first =
                    &mut self.cubes[*cube as usize].firsts[place(new.blocks[spot.block()].0)];
                self.next.push(std::mem::replace(first, self.points.len() as u32));
                self.points.push(point);
            }
        }
        for corner in bounds(&self.points[num_before..]).into_iter().flatten() {
            self.bounds_m = self.bounds_m.extended(corner.map(f64::from));
        }
    }

    /// Return the points by block.
    pub(crate) fn blocks(&self) -> CloudBlocks<'_> {
        let (mut blocks, mut firsts) = (Vec::new(), Vec::new());
        for cube in &self.cubes {
            for place in ones(cube.blocks) {
                blocks.push((block_at(cube.voxel, place), cube.bits[place]));
                firsts.push(cube.firsts[place]);
            }
        }
        CloudBlocks { cloud: self, blocks, firsts }
    }

    /// Note that all points are one cluster.
    pub(crate) fn know_one_cluster(&mut self) {
        self.num_old = self.points.len();
    }
}

/// The points of a [`Cloud`] by block.
pub(crate) struct CloudBlocks<'a> {
    cloud: &'a Cloud,
    blocks: Vec<(Voxel, u64)>,
    /// A point of each block.
    firsts: Vec<u32>,
}

impl Blocks for CloudBlocks<'_> {
    fn blocks(&self) -> &[(Voxel, u64)] {
        &self.blocks
    }

    fn points(&self) -> &[Point] {
        &self.cloud.points
    }

    fn num_old(&self) -> usize {
        self.cloud.num_old
    }

    fn indices(&self, block: usize) -> impl Iterator<Item = usize> {
        chain(&self.cloud.next, self.firsts[block]).map(|index| index as usize)
    }
}
