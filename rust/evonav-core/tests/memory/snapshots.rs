//! Co-visibility clustering against a twin that works on sets, and by what must always hold.
use std::collections::BTreeSet;

use evonav_core::memory::snapshots::{Frame, Located, Snapshot, two_means, update_snapshots};
use proptest::{collection::vec, prelude::*};

type Set = BTreeSet<u64>;

fn located(centres: &[[f64; 2]]) -> Vec<Located> {
    (0..).zip(centres).map(|(id, &centre_m)| Located { id, centre_m }).collect()
}

fn frame(seen: &[u64]) -> Frame {
    Frame { seen: seen.iter().map(|&id| (id, 1.0)).collect() }
}

fn ids(frame: &Frame) -> Set {
    frame.seen.iter().map(|seen| seen.0).collect()
}

/// The procedure in its own words, on sets: what to cluster again first, then the bisection.
fn update_naive(
    objects: &[Located],
    frames: &[Frame],
    snapshots: &[Snapshot],
    agent_m: [f64; 2],
    reach_m: f64,
) -> Vec<(usize, Set)> {
    let distance = |o: &Located| {
        ((o.centre_m[0] - agent_m[0]).powi(2) + (o.centre_m[1] - agent_m[1]).powi(2)).sqrt()
    };
    let owner = |id| snapshots.iter().position(|s| s.objects.contains(&id));
    let touched: Set = objects
        .iter()
        .filter(|o| owner(o.id).is_none() || distance(o) < reach_m)
        .map(|o| o.id)
        .collect();
    let is_input = |id: &u64| {
        touched.contains(id)
            || owner(*id).is_some_and(|s| snapshots[s].objects.iter().any(|o| touched.contains(o)))
    };
    let input: Set = objects.iter().map(|o| o.id).filter(is_input).collect();
    let mut result: Vec<(usize, Set)> = snapshots
        .iter()
        .filter(|s| !s.objects.iter().any(|id| input.contains(id)))
        .map(|s| (s.frame, s.objects.iter().copied().collect()))
        .collect();
    let mut leaves: Vec<Set> = vec![input];
    let mut chosen: BTreeSet<usize> = BTreeSet::new();
    while !leaves.is_empty() {
        let size = leaves.iter().map(BTreeSet::len).max().unwrap();
        let leaf = leaves.remove(leaves.iter().position(|leaf| leaf.len() == size).unwrap());
        let full: Vec<usize> = (0..frames.len())
            .filter(|&f| !leaf.is_empty() && leaf.is_subset(&ids(&frames[f])))
            .collect();
        let mut pool: Vec<usize> = full.iter().copied().filter(|f| chosen.contains(f)).collect();
        if pool.is_empty() {
            pool = full;
        }
        // Longest list, then surest, then oldest: a stable sort three times over, the last key first.
        let sum = |f: usize| frames[f].seen.iter().map(|seen| seen.1).sum::<f64>();
        pool.sort_by(|&a, &b| sum(b).partial_cmp(&sum(a)).unwrap());
        pool.sort_by_key(|&f| std::cmp::Reverse(frames[f].seen.len()));
        if let Some(&best) = pool.first() {
            chosen.insert(best);
            match result.iter_mut().find(|(f, _)| *f == best) {
                Some((_, cluster)) => cluster.extend(leaf),
                None => result.push((best, leaf)),
            }
        } else if leaf.len() > 1 {
            let members: Vec<u64> = leaf.into_iter().collect();
            let centre = |id: &u64| objects.iter().find(|o| o.id == *id).unwrap().centre_m;
            let is_second = two_means(&members.iter().map(centre).collect::<Vec<_>>());
            for side in [false, true] {
                leaves.push(
                    (0..members.len())
                        .filter(|&i| is_second[i] == side)
                        .map(|i| members[i])
                        .collect(),
                );
            }
        }
    }
    result.sort();
    result
}

fn as_sets(snapshots: &[Snapshot]) -> Vec<(usize, Set)> {
    snapshots.iter().map(|s| (s.frame, s.objects.iter().copied().collect())).collect()
}

fn worlds() -> impl Strategy<Value = (Vec<[f64; 2]>, Vec<Frame>, [f64; 2], f64)> {
    let coordinate = prop_oneof![0.0..9.0, (0..4_u8).prop_map(f64::from)];
    let centres = vec([coordinate.clone(), coordinate], 0..14);
    let confidence = prop_oneof![Just(1.0), 0.4..1.0];
    let frames = vec(vec((0..14_u64, confidence), 0..8), 0..20).prop_map(|frames| {
        frames
            .into_iter()
            .map(|mut seen| {
                seen.sort_by_key(|s| s.0);
                seen.dedup_by_key(|s| s.0);
                Frame { seen }
            })
            .collect()
    });
    (centres, frames, [0.0..9.0, 0.0..9.0], 0.0..6.0)
}

proptest! {
    /// Twice over, so that the second call meets snapshots: frames come in two parts, the agent moves in between.
    #[test]
    fn clustering_is_that_of_sets((centres, frames, agent_m, reach_m) in worlds(), split in 0.0..1.0) {
        let objects = located(&centres);
        let num = (frames.len() as f64 * split) as usize;
        let before = update_snapshots(&objects, &frames[..num], &[], agent_m, reach_m).unwrap();
        prop_assert_eq!(as_sets(&before), update_naive(&objects, &frames[..num], &[], agent_m, reach_m));
        let there_m = [agent_m[1], agent_m[0]];
        let after = update_snapshots(&objects, &frames, &before, there_m, reach_m).unwrap();
        prop_assert_eq!(as_sets(&after), update_naive(&objects, &frames, &before, there_m, reach_m));
        prop_assert_eq!(&after, &update_snapshots(&objects, &frames, &before, there_m, reach_m).unwrap());
        // Nothing is lost, nothing is there twice, and frames show what they stand for.
        let mut owned: Vec<u64> = after.iter().flat_map(|s| s.objects.clone()).collect();
        owned.sort_unstable();
        let seen: Set = frames.iter().flat_map(ids).collect();
        let expected: Vec<u64> = objects.iter().map(|o| o.id).filter(|id| seen.contains(id)).collect();
        prop_assert_eq!(owned, expected);
        for snapshot in &after {
            prop_assert!(!snapshot.objects.is_empty());
            prop_assert!(snapshot.objects.iter().all(|&id| ids(&frames[snapshot.frame]).contains(&id)));
        }
        prop_assert!(after.windows(2).all(|pair| pair[0].frame < pair[1].frame));
    }

    /// Objects may vanish, and their ids from frames, in any way: what is left is clustered all the same.
    #[test]
    fn vanished_objects_leave((centres, frames, agent_m, reach_m) in worlds(), gone in vec(any::<bool>(), 14)) {
        let objects = located(&centres);
        let before = update_snapshots(&objects, &frames, &[], agent_m, reach_m).unwrap();
        let is_left = |id: u64| !gone[id as usize];
        let left: Vec<Located> = objects.into_iter().filter(|o| is_left(o.id)).collect();
        let trimmed: Vec<Frame> = frames
            .iter()
            .map(|f| Frame { seen: f.seen.iter().copied().filter(|s| is_left(s.0)).collect() })
            .collect();
        let after = update_snapshots(&left, &trimmed, &before, agent_m, reach_m).unwrap();
        let owned: Set = after.iter().flat_map(|s| s.objects.clone()).collect();
        let seen: Set = trimmed.iter().flat_map(ids).collect();
        prop_assert_eq!(owned, left.iter().map(|o| o.id).filter(|id| seen.contains(id)).collect::<Set>());
    }

    /// Whatever the points: two parts, each nearer to its own mean than to the other's.
    #[test]
    fn two_means_is_at_rest(points in vec([-50.0..50.0, -50.0..50.0], 2..40)) {
        let is_second = two_means(&points);
        prop_assert!(is_second.contains(&true) && is_second.contains(&false));
        let mean = |side: bool| {
            let own: Vec<_> = points.iter().zip(&is_second).filter(|(_, s)| **s == side).map(|(p, _)| p).collect();
            [0, 1].map(|axis| own.iter().map(|p| p[axis]).sum::<f64>() / own.len() as f64)
        };
        let means = [mean(false), mean(true)];
        for (p, &second) in points.iter().zip(&is_second) {
            let to = |m: [f64; 2]| (p[0] - m[0]).hypot(p[1] - m[1]);
            prop_assert!(to(means[usize::from(second)]) <= to(means[usize::from(!second)]) + 1e-9);
        }
    }

    /// Two heaps far apart are told apart, whatever they look like and however they are mixed.
    #[test]
    fn two_means_finds_two_heaps(near in vec([0.0..1.0, 0.0..1.0], 1..20), far in vec([0.0..1.0, 30.0..31.0], 1..20), order in any::<u64>()) {
        let mut points: Vec<([f64; 2], bool)> =
            near.into_iter().map(|p| (p, false)).chain(far.into_iter().map(|p| (p, true))).collect();
        points.sort_by_key(|(p, _)| (p[0].to_bits() ^ order).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let is_second = two_means(&points.iter().map(|p| p.0).collect::<Vec<_>>());
        let truth: Vec<bool> = points.iter().map(|p| p.1).collect();
        prop_assert!(is_second == truth || is_second.iter().zip(&truth).all(|(a, b)| a != b));
    }
}

#[test]
fn a_co_visible_pair_shares_a_snapshot() {
    let objects = located(&[[1.0, 1.0], [1.5, 1.0], [7.0, 7.0]]);
    let frames = [frame(&[0]), frame(&[1]), frame(&[0, 1]), frame(&[2])];
    let found = update_snapshots(&objects, &frames, &[], [0.0, 0.0], 4.0).unwrap();
    assert_eq!(as_sets(&found), [(2, Set::from([0, 1])), (3, Set::from([2]))]);
}

#[test]
fn the_longest_list_wins_then_the_surest_then_the_oldest() {
    let objects = located(&[[1.0, 1.0], [1.5, 1.0], [9.0, 9.0]]);
    let of = |frames: &[Frame]| {
        let near = &objects[..2];
        update_snapshots(near, frames, &[], [0.0, 0.0], 4.0).unwrap()[0].frame
    };
    assert_eq!(of(&[frame(&[0, 1]), frame(&[0, 1, 2]), frame(&[0, 1])]), 1);
    let sure = |confidence| Frame { seen: vec![(0, confidence), (1, 0.5)] };
    assert_eq!(of(&[sure(0.5), sure(0.9), sure(0.7)]), 1);
    assert_eq!(of(&[sure(0.9), sure(0.9)]), 0);
}

#[test]
fn a_frame_chosen_before_is_preferred() {
    // The four are split; 0 and 1 take frame 0; the single 3 could have the longer frame 2, but 0 is chosen already.
    let objects = located(&[[0.0, 0.0], [0.1, 0.0], [8.0, 0.0], [9.5, 0.0]]);
    let frames = [frame(&[0, 1, 3]), frame(&[2, 7, 8, 9]), frame(&[3, 4, 5, 6])];
    let found = update_snapshots(&objects, &frames, &[], [0.0, 0.0], 4.0).unwrap();
    assert_eq!(as_sets(&found), [(0, Set::from([0, 1, 3])), (1, Set::from([2]))]);
}

#[test]
fn far_snapshots_stay_and_new_clusters_are_appended_to_them() {
    let objects = located(&[[20.0, 0.0], [1.0, 0.0]]);
    let frames = [frame(&[0, 1]), frame(&[0])];
    // Not what clustering would choose: it is kept because it is far away.
    let kept = [Snapshot { frame: 1, objects: vec![0] }];
    let found = update_snapshots(&objects, &frames, &kept, [0.0, 0.0], 4.0).unwrap();
    assert_eq!(as_sets(&found), [(0, Set::from([1])), (1, Set::from([0]))]);
    let kept = [Snapshot { frame: 0, objects: vec![0] }];
    let found = update_snapshots(&objects, &frames, &kept, [0.0, 0.0], 4.0).unwrap();
    assert_eq!(found, [Snapshot { frame: 0, objects: vec![0, 1] }]);
}

#[test]
fn who_shares_a_snapshot_with_a_near_object_is_clustered_with_it() {
    let objects = located(&[[1.0, 0.0], [20.0, 0.0]]);
    let frames = [frame(&[0, 1]), frame(&[0, 2]), frame(&[0, 1, 3])];
    let kept = [Snapshot { frame: 0, objects: vec![0, 1] }];
    let found = update_snapshots(&objects, &frames, &kept, [0.0, 0.0], 4.0).unwrap();
    assert_eq!(as_sets(&found), [(2, Set::from([0, 1]))]);
}

#[test]
fn what_a_snapshot_does_not_show_any_more_leaves_it() {
    let objects = located(&[[20.0, 0.0], [21.0, 0.0]]);
    let frames = [frame(&[0]), frame(&[1])];
    let kept = [Snapshot { frame: 0, objects: vec![0, 1] }];
    let found = update_snapshots(&objects, &frames, &kept, [0.0, 0.0], 4.0).unwrap();
    assert_eq!(as_sets(&found), [(0, Set::from([0])), (1, Set::from([1]))]);
}

#[test]
fn what_no_frame_shows_ends_the_search() {
    let objects = located(&[[1.0, 1.0], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0]]);
    let found = update_snapshots(&objects, &[frame(&[3])], &[], [0.0, 0.0], 4.0).unwrap();
    assert_eq!(as_sets(&found), [(0, Set::from([3]))]);
    assert!(update_snapshots(&objects, &[], &[], [0.0, 0.0], 4.0).unwrap().is_empty());
    assert!(two_means(&[]).is_empty());
}

#[test]
fn bad_input_is_named() {
    let one = located(&[[1.0, f64::NAN]]);
    let message =
        |result: Result<Vec<Snapshot>, evonav_core::Error>| result.unwrap_err().to_string();
    assert!(message(update_snapshots(&one, &[], &[], [0.0; 2], 4.0)).contains("objects.centre_m"));
    assert!(
        message(update_snapshots(&[], &[], &[], [f64::INFINITY, 0.0], 4.0)).contains("agent_m")
    );
    assert!(message(update_snapshots(&[], &[], &[], [0.0; 2], -1.0)).contains("reach_m"));
    let twice = [Located { id: 4, centre_m: [0.0; 2] }; 2];
    assert!(message(update_snapshots(&twice, &[], &[], [0.0; 2], 4.0)).contains("each id once"));
    let dangling = [Snapshot { frame: 2, objects: vec![] }];
    assert!(
        message(update_snapshots(&[], &[], &dangling, [0.0; 2], 4.0)).contains("snapshots.frame")
    );
}
