//! Many agents, each in its own house or in a shared one, that are stepped and rendered together.
//!
//! Actions and images of an agent in a batch are exactly those of an agent alone, whatever the
//! number of threads: agents share only houses, which do not change.

use std::sync::{Arc, Mutex, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::{
    Error,
    geometry::Vec2,
    sensors::{
        instance_masks::{MaskFilter, number_instances},
        raster::FrameBuffer,
    },
    simulator::{
        actions::{Action, Strides, act, set_down},
        batch_slot::Slot,
        geodesic_field::GeodesicField,
    },
};

/// Largest number of agents of a batch, and of threads.
const MAX_SLOTS: usize = 1 << 16;

/// Number of agents from which on their steps are shared between threads.
const MIN_SHARED_STEPS: usize = 32;

/// The settings of all agents of a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BatchConfig {
    /// Columns and rows of images, the same as those of every house's camera.
    pub image_px: [usize; 2],
    /// Depth of pixels without a surface.
    pub empty_depth_m: f32,
    /// Sizes of discrete actions.
    pub strides: Strides,
    /// Spacing of the positions from which the nearest reachable one is used if a target cannot be
    /// reached.
    pub grid_m: f64,
    /// Masks that count in images of labels.
    pub mask_filter: MaskFilter,
    /// Number of threads that step and render, the caller's among them.
    pub num_threads: usize,
    /// Number of pixels of a batch from which on the threads share its images: to wake a thread up
    /// takes as long as to draw some, and much longer on a busy machine.
    pub min_shared_px: usize,
}

/// The result of a step of one agent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stepped {
    /// Whether the action was carried out; otherwise the pose did not change.
    pub is_success: bool,
    /// Value of [`Slot::distance_m`] after the step.
    pub distance_m: f64,
}

/// The arrays for a batch's images: agent after agent, row-major; `None` if not rendered.
#[derive(Debug, Default)]
pub struct Images<'a> {
    /// Planar depth in metres, `(B, H, W)`.
    pub depth_m: Option<&'a mut [f32]>,
    /// Colours, sRGB, `(B, H, W, 3)`.
    pub rgb: Option<&'a mut [u8]>,
    /// Labels of the bodies, `(B, H, W)`.
    pub labels: Option<&'a mut [u8]>,
}

/// A batch of agents.
#[derive(Debug)]
pub struct Batch {
    config: BatchConfig,
    slots: Vec<Option<Slot>>,
    /// Threads beside the caller's; `None` if there are none.
    pool: Option<ThreadPool>,
    /// Working memory, one per thread; the caller's is the first.
    frames: Vec<Mutex<FrameBuffer>>,
}

impl Batch {
    /// Create a batch of `num_slots` agents that are in no house yet: [`Self::place`] puts them
    /// there.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if there are no agents or no threads, or too many;
    /// [`Error::Simulation`] if threads cannot be started.
    pub fn new(num_slots: usize, config: BatchConfig) -> Result<Self, Error> {
        let is_number = |n: usize| (1..=MAX_SLOTS).contains(&n);
        Error::require("num_slots", num_slots, "1 to 65536", is_number)?;
        Error::require("num_threads", config.num_threads, "1 to 65536", is_number)?;
        let Strides { move_m, turn_rad } = config.strides;
        Error::require("move_m", move_m, "finite", f64::is_finite)?;
        Error::require("turn_rad", turn_rad, "finite", f64::is_finite)?;
        let started = |_| Error::Simulation {
            message: format!("cannot start {} threads", config.num_threads),
        };
        let pool = (config.num_threads > 1)
            .then(|| ThreadPoolBuilder::new().num_threads(config.num_threads - 1).build())
            .transpose()
            .map_err(started)?;
        let frames = (0..config.num_threads).map(|_| Mutex::default()).collect();
        Ok(Self { config, slots: vec![None; num_slots], pool, frames })
    }

    /// Return the number of agents.
    pub fn num_slots(&self) -> usize {
        self.slots.len()
    }

    /// Return the settings of all agents.
    pub fn config(&self) -> &BatchConfig {
        &self.config
    }

    /// Put an agent into a house; its pose is not changed.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if there is no such agent, or the house has another image size or
    /// another number of bodies than there are labels.
    pub fn place(&mut self, index: usize, slot: Slot) -> Result<(), Error> {
        let (image_px, num_labels) = (slot.world.image_px(), slot.labels.len());
        if image_px != self.config.image_px {
            let expected = format!("{:?}, the batch's", self.config.image_px);
            return Err(Error::invalid("image_px", format!("{image_px:?}"), &expected));
        }
        if num_labels != slot.world.bodies().len() {
            let expected = format!("{}, one a body", slot.world.bodies().len());
            return Err(Error::invalid("labels", num_labels, &expected));
        }
        *self.slot_mut(index)? = Some(slot);
        Ok(())
    }

    /// Set or remove the goal of an agent.
    ///
    /// # Errors
    /// As [`Self::slot`].
    pub fn aim(&mut self, index: usize, field: Option<Arc<GeodesicField>>) -> Result<(), Error> {
        let slot = self.placed_mut(index)?;
        (slot.field, slot.known_m) = (field, None);
        Ok(())
    }

    /// Return an agent.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if there is no such agent; [`Error::Simulation`] if it is in no
    /// house.
    pub fn slot(&self, index: usize) -> Result<&Slot, Error> {
        let slot = self.slots.get(index).ok_or_else(|| no_slot(index, self.slots.len()))?;
        slot.as_ref().ok_or_else(|| nowhere(index))
    }

    /// Carry out one action of each agent; an agent that would collide stays where it is.
    ///
    /// # Arguments
    /// * `actions` - numbers of [`Action::of`], by agent.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the number of actions is not that of the agents, or an action
    /// does not exist; [`Error::Simulation`] if an agent is in no house. Then no agent has moved.
    ///
    /// # Complexity
    /// O(obstacles near) an agent, O(nodes of the visibility graph) for its distance.
    pub fn step(&mut self, actions: &[u8]) -> Result<Vec<Stepped>, Error> {
        self.require_one_each("actions", actions.len())?;
        let actions: Vec<Action> =
            actions.iter().map(|&number| Action::of(number)).collect::<Result<_, _>>()?;
        let strides = self.config.strides;
        let one = |(slot, action): (&mut Slot, Action)| {
            let moved = act(&slot.world, &slot.pose, action, strides);
            slot.go(moved.unwrap_or(slot.pose));
            let distance_m = slot.distance_m();
            slot.known_m = Some(distance_m);
            Stepped { is_success: moved.is_some(), distance_m }
        };
        // Waking a thread takes as long as some steps.
        let pool = self.pool.as_ref().filter(|_| self.slots.len() >= MIN_SHARED_STEPS);
        let slots = placed(&mut self.slots)?;
        Ok(each(pool, slots.into_iter().zip(actions).collect(), one))
    }

    /// Return the shortest path of each agent to its target. If a target cannot be reached, the
    /// path leads to the nearest position that the agent could reach along a grid when this first
    /// happened.
    ///
    /// # Returns
    /// Corners of each path, including both ends; empty if there is no path, or the target is
    /// `None`.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the number of targets is not that of the agents;
    /// [`Error::Simulation`] if an agent is in no house.
    pub fn plan(&mut self, targets_m: &[Option<Vec2>]) -> Result<Vec<Vec<Vec2>>, Error> {
        self.require_one_each("targets_m", targets_m.len())?;
        let grid_m = self.config.grid_m;
        let one = |(slot, target_m): (&mut Slot, Option<Vec2>)| {
            target_m.map_or_else(|| Ok(Vec::new()), |target_m| slot.plan(target_m, grid_m))
        };
        let pool = self.pool.as_ref();
        let slots = placed(&mut self.slots)?;
        each(pool, slots.into_iter().zip(targets_m.iter().copied()).collect(), one)
            .into_iter()
            .collect()
    }

    /// Return the shortest path of one agent, as [`Self::plan`].
    ///
    /// # Errors
    /// As [`Self::slot`].
    pub fn plan_one(&mut self, index: usize, target_m: Vec2) -> Result<Vec<Vec2>, Error> {
        let grid_m = self.config.grid_m;
        self.placed_mut(index)?.plan(target_m, grid_m)
    }

    /// Put an agent at points in turn, until it does not fit.
    ///
    /// # Arguments
    /// * `stops` - `[x, z]` and yaw of each point.
    ///
    /// # Returns
    /// Number of points at which it was put.
    ///
    /// # Errors
    /// As [`Self::slot`].
    pub fn follow(&mut self, index: usize, stops: &[(Vec2, f64)]) -> Result<usize, Error> {
        let slot = self.placed_mut(index)?;
        for (passed, &(point_m, yaw_rad)) in stops.iter().enumerate() {
            match set_down(&slot.world, &slot.pose, point_m, yaw_rad) {
                Some(pose) => slot.go(pose),
                None => return Ok(passed),
            }
        }
        Ok(stops.len())
    }

    /// Render the views of all agents.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if an array does not have the batch's size, or a house's labels
    /// or camera cannot be used; [`Error::Simulation`] if an agent is in no house.
    ///
    /// # Complexity
    /// That of [`crate::sensors::raster::render_view`] for each agent.
    pub fn render(&self, images: Images<'_>) -> Result<(), Error> {
        let slots: Vec<&Slot> =
            (0..self.slots.len()).map(|index| self.slot(index)).collect::<Result<_, _>>()?;
        let [width_px, height_px] = self.config.image_px;
        let num_pixels = width_px * height_px;
        let depth_m = parts("depth_m", images.depth_m, slots.len(), num_pixels)?;
        let rgb = parts("rgb", images.rgb, slots.len(), 3 * num_pixels)?;
        let labels = parts("labels", images.labels, slots.len(), num_pixels)?;
        let jobs: Vec<_> = slots.into_iter().zip(depth_m).zip(rgb).zip(labels).collect();
        let one = |(((slot, depth_m), rgb), labels): (((&Slot, _), _), _)| {
            self.draw(slot, Images { depth_m, rgb, labels })
        };
        let num_shared_px = jobs.len() * num_pixels;
        let pool = self.pool.as_ref().filter(|_| num_shared_px >= self.config.min_shared_px);
        each(pool, jobs, one).into_iter().collect()
    }

    fn draw(&self, slot: &Slot, images: Images<'_>) -> Result<(), Error> {
        // The index may be that of another pool's thread, if the caller is in one.
        let thread = rayon::current_thread_index().map_or(0, |index| index + 1);
        let thread = thread % self.frames.len();
        // The content is overwritten, so a thread that panicked has left nothing that matters.
        let mut frame = self.frames[thread].lock().unwrap_or_else(PoisonError::into_inner);
        frame.empty_depth_m = Some(self.config.empty_depth_m);
        frame.has_runs = true;
        let want = slot.world.want(images.rgb.is_some(), images.labels.is_some());
        slot.world.render(&slot.world.view(&slot.pose), want, &mut frame)?;
        if let Some(depth_m) = images.depth_m {
            depth_m.copy_from_slice(&frame.depth_m);
        }
        if let Some(rgb) = images.rgb {
            rgb.copy_from_slice(&frame.rgb);
        }
        if let Some(labels) = images.labels {
            let is_detectable: Vec<bool> = slot.labels.iter().map(|&label| label != 0).collect();
            let masks =
                number_instances(&frame.instance_runs, &is_detectable, self.config.mask_filter)?;
            let mut begin = 0;
            for &[end, mask] in masks.labels.ends() {
                let label = usize::try_from(mask).map_or(0, |m| slot.labels[masks.instances[m]]);
                labels[begin..end as usize].fill(label);
                begin = end as usize;
            }
        }
        Ok(())
    }

    fn slot_mut(&mut self, index: usize) -> Result<&mut Option<Slot>, Error> {
        let num_slots = self.slots.len();
        self.slots.get_mut(index).ok_or_else(|| no_slot(index, num_slots))
    }

    fn placed_mut(&mut self, index: usize) -> Result<&mut Slot, Error> {
        self.slot_mut(index)?.as_mut().ok_or_else(|| nowhere(index))
    }

    fn require_one_each(&self, name: &str, num: usize) -> Result<(), Error> {
        let expected = format!("{}, one an agent", self.slots.len());
        Error::require(name, num, &expected, |num| num == self.slots.len())
    }
}

/// Return all agents, if every one is in a house.
fn placed(slots: &mut [Option<Slot>]) -> Result<Vec<&mut Slot>, Error> {
    let slots = slots.iter_mut().enumerate();
    slots.map(|(index, slot)| slot.as_mut().ok_or_else(|| nowhere(index))).collect()
}

/// Split an array into the images of the agents.
fn parts<'a, T>(
    name: &str,
    array: Option<&'a mut [T]>,
    num_slots: usize,
    num_elements: usize,
) -> Result<Vec<Option<&'a mut [T]>>, Error> {
    let Some(array) = array else {
        return Ok((0..num_slots).map(|_| None).collect());
    };
    let expected = format!("{} elements", num_slots * num_elements);
    Error::require(name, array.len(), &expected, |num| num == num_slots * num_elements)?;
    Ok(array.chunks_exact_mut(num_elements).map(Some).collect())
}

/// Run every job, in this thread and the pool's if there is a pool; results are in the jobs' order.
///
/// This thread begins at once, so that the others may take their time to wake up.
fn each<T: Send, U: Send>(
    pool: Option<&ThreadPool>,
    jobs: Vec<T>,
    one: impl Fn(T) -> U + Sync,
) -> Vec<U> {
    let num_helpers = pool.map_or(0, ThreadPool::current_num_threads).min(jobs.len() / 2);
    let Some(pool) = pool.filter(|_| num_helpers > 0) else {
        return jobs.into_iter().map(one).collect();
    };
    let (jobs, done) = (Mutex::new(jobs.into_iter().enumerate()), Mutex::new(Vec::new()));
    let next = || jobs.lock().unwrap_or_else(PoisonError::into_inner).next();
    let work = || {
        let mut mine = Vec::new();
        while let Some((index, job)) = next() {
            mine.push((index, one(job)));
        }
        done.lock().unwrap_or_else(PoisonError::into_inner).append(&mut mine);
    };
    pool.in_place_scope(|scope| {
        (0..num_helpers).for_each(|_| scope.spawn(|_| work()));
        work();
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_unstable_by_key(|&(index, _)| index);
    done.into_iter().map(|(_, result)| result).collect()
}

fn no_slot(index: usize, num_slots: usize) -> Error {
    Error::invalid("slot", index, &format!("below {num_slots}"))
}

fn nowhere(index: usize) -> Error {
    Error::Simulation { message: format!("agent {index} of the batch is in no house: place it") }
}
