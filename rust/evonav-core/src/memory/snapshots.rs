//! 3D-Mem's snapshots: a few of the stored views, which together show every remembered object once.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet},
};

use crate::{Error, rng::Stream};

/// Number of starts of 2-means; the tightest result is used.
const NUM_STARTS: usize = 10;
/// Seed of the starts of 2-means.
const SEED: u64 = 66;
/// Largest number of rounds of Lloyd's algorithm.
const MAX_ROUNDS: usize = 300;

/// A remembered object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Located {
    /// Id of its entry.
    pub id: u64,
    /// Centre, `[x, z]`, world frame.
    pub centre_m: [f64; 2],
}

/// The detections in a stored view.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frame {
    /// Ids of entries, each with the confidence of its detection.
    pub seen: Vec<(u64, f64)>,
}

impl Frame {
    fn shows(&self, id: u64) -> bool {
        self.seen.iter().any(|&(seen, _)| seen == id)
    }
}

/// A frame, and the objects that it represents.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Snapshot {
    /// Index of the frame.
    pub frame: usize,
    /// Ids of the cluster's objects, never empty; the frame shows all of them.
    pub objects: Vec<u64>,
}

/// Update snapshots by co-visibility clustering.
///
/// Objects in no snapshot, objects near the agent, and all objects that share a snapshot with one
/// of them are clustered again; other snapshots stay. Clusters are found by bisection: the group
/// with the most objects (of equals the older one) becomes a cluster if some frame shows all of it;
/// otherwise 2-means splits it. Of several such frames, one that was chosen before in this call is
/// preferred, then the one that shows the most objects, then the one with the largest sum of
/// confidences, then the oldest. A cluster whose frame is already a snapshot is appended to it.
///
/// # Arguments
/// * `objects` - all remembered objects, each id once.
/// * `frames` - stored views, oldest first.
/// * `snapshots` - the previous snapshots; objects that are no longer remembered, or not in their
///   frame, are removed.
/// * `agent_m` - position of the agent, `[x, z]`, world frame.
/// * `reach_m` - distance within which objects are clustered again (3D-Mem: 4.0 m).
///
/// # Returns
/// Snapshots by ascending frame. Every object that some frame shows is in exactly one of them.
///
/// # Errors
/// [`Error::InvalidArgument`] if a position is not finite, an id occurs twice, or a snapshot's frame does not exist.
///
/// # Complexity
/// O(objects x frames x objects / 64) in the worst case; each split costs a 2-means of its group.
///
/// # Source
/// Yang et al., "3D-Mem: 3D Scene Memory for Embodied Exploration and Reasoning", CVPR 2025.
pub fn update_snapshots(
    objects: &[Located],
    frames: &[Frame],
    snapshots: &[Snapshot],
    agent_m: [f64; 2],
    reach_m: f64,
) -> Result<Vec<Snapshot>, Error> {
    let centres = check(objects, frames, snapshots, agent_m, reach_m)?;
    let mut clusters_by_frame: BTreeMap<usize, Vec<u64>> = BTreeMap::new();
    let mut unowned: BTreeSet<u64> = centres.keys().copied().collect();
    for snapshot in snapshots {
        for &id in &snapshot.objects {
            if frames[snapshot.frame].shows(id) && unowned.remove(&id) {
                clusters_by_frame.entry(snapshot.frame).or_default().push(id);
            }
        }
    }
    let is_near = |id: &u64| {
        let [x, z] = centres[id];
        (x - agent_m[0]).hypot(z - agent_m[1]) < reach_m
    };
    let mut input = unowned;
    clusters_by_frame.retain(|_, cluster| {
        let is_dissolved = cluster.iter().any(is_near);
        if is_dissolved {
            input.extend(cluster.iter().copied());
        }
        !is_dissolved
    });
    let input: Vec<Located> =
        input.into_iter().map(|id| Located { id, centre_m: centres[&id] }).collect();
    for (frame, cluster) in clusters(&input, frames) {
        clusters_by_frame.entry(frame).or_default().extend(cluster);
    }
    Ok(clusters_by_frame.into_iter().map(|(frame, objects)| Snapshot { frame, objects }).collect())
}

fn check(
    objects: &[Located],
    frames: &[Frame],
    snapshots: &[Snapshot],
    agent_m: [f64; 2],
    reach_m: f64,
) -> Result<BTreeMap<u64, [f64; 2]>, Error> {
    Error::require_finite("agent_m", &agent_m)?;
    Error::require("reach_m", reach_m, "finite and >= 0", |m| m.is_finite() && m >= 0.0)?;
    let mut centres = BTreeMap::new();
    for object in objects {
        Error::require_finite("objects.centre_m", &object.centre_m)?;
        if centres.insert(object.id, object.centre_m).is_some() {
            return Err(Error::invalid("objects.id", object.id, "each id once"));
        }
    }
    for snapshot in snapshots {
        Error::require("snapshots.frame", snapshot.frame, "a frame's index", |i| i < frames.len())?;
    }
    Ok(centres)
}

/// Group objects into clusters, each with a frame that shows all of it. Objects that no frame shows
/// are left out.
fn clusters(objects: &[Located], frames: &[Frame]) -> Vec<(usize, Vec<u64>)> {
    let sets = FrameSets::new(objects, frames);
    let mut is_chosen = vec![false; frames.len()];
    let mut found = Vec::new();
    let mut leaves: Vec<Vec<usize>> = vec![(0..objects.len()).collect()];
    while let Some(largest) = (0..leaves.len()).max_by_key(|&i| (leaves[i].len(), Reverse(i))) {
        let leaf = leaves.remove(largest);
        if let Some(frame) = sets.best(&leaf, &is_chosen) {
            is_chosen[frame] = true;
            found.push((frame, leaf.iter().map(|&i| objects[i].id).collect()));
        } else if leaf.len() > 1 {
            let points: Vec<[f64; 2]> = leaf.iter().map(|&i| objects[i].centre_m).collect();
            let is_second = two_means(&points);
            for side in [false, true] {
                let half = leaf.iter().zip(&is_second).filter(|&(_, &second)| second == side);
                leaves.push(half.map(|(&i, _)| i).collect());
            }
        }
    }
    found
}

/// The objects that each frame shows, one bit per object.
struct FrameSets {
    num_words: usize,
    /// Frames that show any object, by index.
    frames: Vec<(usize, Vec<u64>)>,
    /// Number of detections of each frame, and sum of their confidences.
    ranks: Vec<(usize, f64)>,
}

impl FrameSets {
    fn new(objects: &[Located], frames: &[Frame]) -> Self {
        let bit_of: BTreeMap<u64, usize> =
            objects.iter().enumerate().map(|(bit, object)| (object.id, bit)).collect();
        let num_words = objects.len().div_ceil(64);
        let mut sets = Vec::new();
        for (index, frame) in frames.iter().enumerate() {
            let mut bits = vec![0_u64; num_words];
            for bit in frame.seen.iter().filter_map(|(id, _)| bit_of.get(id)) {
                bits[bit / 64] |= 1 << (bit % 64);
            }
            if bits.iter().any(|&word| word != 0) {
                sets.push((index, bits));
            }
        }
        let rank = |frame: &Frame| {
            // Values that are not finite must not break the order.
            let sum: f64 = frame.seen.iter().map(|&(_, c)| c).filter(|c| c.is_finite()).sum();
            (frame.seen.len(), sum)
        };
        Self { num_words, frames: sets, ranks: frames.iter().map(rank).collect() }
    }

    /// Return the best frame for a group, if any frame shows all of it.
    fn best(&self, group: &[usize], is_chosen: &[bool]) -> Option<usize> {
        let mut wanted = vec![0_u64; self.num_words];
        group.iter().for_each(|bit| wanted[bit / 64] |= 1 << (bit % 64));
        let shows_all =
            |words: &[u64]| words.iter().zip(&wanted).all(|(has, want)| want & !has == 0);
        let qualified =
            self.frames.iter().filter(|(_, words)| shows_all(words)).map(|&(index, _)| index);
        qualified.max_by(|&a, &b| {
            let (rank_a, rank_b) = (self.ranks[a], self.ranks[b]);
            is_chosen[a]
                .cmp(&is_chosen[b])
                .then(rank_a.0.cmp(&rank_b.0))
                .then(rank_a.1.total_cmp(&rank_b.1))
                .then(b.cmp(&a))
        })
    }
}

/// Split points in two by 2-means, using the tightest of ten results of Lloyd's algorithm.
///
/// Starts are drawn as in k-means++ (Arthur & Vassilvitskii, SODA 2007) with a fixed seed, so that
/// the same points are always split in the same way.
///
/// # Arguments
/// * `points_m` - points `[x, z]`, finite.
///
/// # Returns
/// Whether each point belongs to the second part. With two or more points no part is empty; points
/// that are all at one place are halved in their order.
pub fn two_means(points_m: &[[f64; 2]]) -> Vec<bool> {
    let mut stream = Stream::new(SEED, &["snapshots", "2-means"]);
    let mut best: Option<(f64, Vec<bool>)> = None;
    for _ in 0..NUM_STARTS {
        let first = points_m.get(stream.below(points_m.len())).copied().unwrap_or_default();
        let weights: Vec<f64> = points_m.iter().map(|&p| distance2(p, first)).collect();
        let Some(second) = stream.choose_weighted(&weights) else { break };
        let (spread, is_second) = lloyd(points_m, [first, points_m[second]]);
        let is_split = is_second.contains(&true) && is_second.contains(&false);
        if is_split && best.as_ref().is_none_or(|(least, _)| spread < *least) {
            best = Some((spread, is_second));
        }
    }
    best.map_or_else(
        || (0..points_m.len()).map(|i| i >= points_m.len().div_ceil(2)).collect(),
        |(_, is_second)| is_second,
    )
}

/// Run Lloyd's algorithm; return the sum of squared distances to the means, and whether each point
/// belongs to the second.
fn lloyd(points_m: &[[f64; 2]], mut means_m: [[f64; 2]; 2]) -> (f64, Vec<bool>) {
    let mut is_second = Vec::new();
    for _ in 0..MAX_ROUNDS {
        let nearest: Vec<bool> =
            points_m.iter().map(|&p| distance2(p, means_m[1]) < distance2(p, means_m[0])).collect();
        if nearest == is_second {
            break;
        }
        is_second = nearest;
        for side in [false, true] {
            let own = || points_m.iter().zip(&is_second).filter(move |&(_, &s)| s == side);
            let num = own().count();
            if num > 0 {
                means_m[usize::from(side)] =
                    [0, 1].map(|axis| own().map(|(p, _)| p[axis]).sum::<f64>() / num as f64);
            }
        }
    }
    let own_mean = points_m.iter().zip(&is_second).map(|(&p, &s)| (p, means_m[usize::from(s)]));
    (own_mean.map(|(p, mean)| distance2(p, mean)).sum(), is_second)
}

fn distance2(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
}
