//! The generator's draws against the probabilities that the paper states.

use evonav_core::{
    generation::{
        Candidate, GoalBias, Mode, Parameters, RoomHistory, evolved_room_weight, goal_room_weights,
        sample_evolved_room, sample_goal, target_scores,
    },
    rng::Stream,
};
use proptest::{collection::vec, prelude::*};

/// Pearson's statistic of `observed` counts against `expected` probabilities.
fn chi_square(observed: &[usize], expected: &[f64]) -> f64 {
    let total: usize = observed.iter().sum();
    let terms = observed.iter().zip(expected).filter(|(_, p)| **p > 0.0).map(|(&n, &p)| {
        let mean = total as f64 * p;
        (n as f64 - mean).powi(2) / mean
    });
    terms.sum()
}

const NUM_DRAWS: usize = 40_000;

#[test]
fn modes_are_drawn_as_half_two_fifths_one_tenth() {
    let mut stream = Stream::new(7, &["modes"]);
    let mut counts = [0; 3];
    for _ in 0..NUM_DRAWS {
        let mode = Mode::sample(&Parameters::default(), &mut stream).unwrap();
        counts[Mode::ALL.iter().position(|&m| m == mode).unwrap()] += 1;
    }
    assert!(chi_square(&counts, &[0.5, 0.4, 0.1]) < 13.8, "{counts:?}"); // p = 0.001, 2 d.o.f.
}

/// Each transition of each task has streams of its own, of which only the first draws count: they
/// must be as even over labels as one stream is over draws, and the mode not follow the trigger.
#[test]
fn first_draws_of_named_streams_are_even_over_tasks_and_stages() {
    let parameters = Parameters::default();
    let mut counts = [[0; 3]; 2];
    for seed in 0..10 {
        for (task, stage) in (0..2_000).flat_map(|t| (2..6).map(move |s| (t, s))) {
            let (label, stage) = (format!("{task:08x}"), format!("stage {stage}"));
            let stream = |what| Stream::new(seed, &[&label, &stage, what]);
            let is_evolved = stream("trigger").uniform() < parameters.evolve_probability;
            let mode = Mode::sample(&parameters, &mut stream("mode")).unwrap();
            let mode = Mode::ALL.iter().position(|&m| m == mode).unwrap();
            counts[usize::from(is_evolved)][mode] += 1;
        }
    }
    let expected = [0.25, 0.2, 0.05, 0.25, 0.2, 0.05];
    assert!(chi_square(&counts.concat(), &expected) < 20.5, "{counts:?}"); // p = 0.001, 5 d.o.f.
}

/// Stages and triggers of 40,000 houses, from streams as the generator names them.
#[test]
fn evolutions_a_task_are_as_likely_as_stated() {
    let parameters = Parameters::default();
    let mut by_evolutions = [0; 5];
    let mut by_pairs = [0; 4];
    for house in 0..NUM_DRAWS {
        let label = format!("{:064x}", (house as u128).wrapping_mul(0x9e37_79b9_7f4a_7c15_f39c));
        let first = |stage: usize, what: &str| {
            Stream::new((house % 5) as u64, &[&label, &format!("stage {stage}"), what])
        };
        let num_stages = parameters.num_stages[first(0, "num_stages").below(3)];
        let is_triggered: Vec<bool> = (2..=num_stages)
            .map(|k| first(k, "trigger").uniform() < parameters.evolve_probability)
            .collect();
        by_evolutions[is_triggered.iter().filter(|&&is| is).count()] += 1;
        by_pairs[2 * usize::from(is_triggered[0]) + usize::from(is_triggered[1])] += 1;
    }
    // p = 0.001 with 4 and 3 degrees of freedom.
    let shares = [7.0 / 48.0, 18.0 / 48.0, 16.0 / 48.0, 6.0 / 48.0, 1.0 / 48.0];
    assert!(chi_square(&by_evolutions, &shares) < 18.5, "{by_evolutions:?}");
    assert!(chi_square(&by_pairs, &[0.25; 4]) < 16.3, "{by_pairs:?}");
}

/// A house with one room of each kind: the weights by hand, and the draws by chi-square.
#[test]
fn rooms_are_drawn_by_assets_visits_transition_and_recent_change() {
    let room = |num_assets, is_visited, is_transition_room, was_changed_recently| RoomHistory {
        num_assets,
        is_visited,
        is_transition_room,
        was_changed_recently,
    };
    let rooms = [
        room(10, false, false, false),
        room(10, true, false, false),
        room(10, true, false, true),
        room(40, true, true, false),
        room(4, false, false, true),
        room(0, true, false, false),
    ];
    let weights = [10.0, 30.0, 15.0, 0.0, 2.0, 0.0];
    let parameters = Parameters::default();
    let mut stream = Stream::new(1, &["rooms"]);
    let mut counts = [0; 6];
    for _ in 0..NUM_DRAWS {
        let (index, found) = sample_evolved_room(&rooms, &parameters, &mut stream);
        assert_eq!(found, weights);
        counts[index.unwrap()] += 1;
    }
    assert_eq!([counts[3], counts[5]], [0, 0]);
    let probabilities = weights.map(|w| w / 57.0);
    assert!(chi_square(&counts, &probabilities) < 16.3, "{counts:?}"); // p = 0.001, 3 d.o.f.
}

#[test]
fn no_room_is_drawn_when_only_the_transition_room_holds_objects() {
    let held = RoomHistory {
        num_assets: 5,
        is_visited: true,
        is_transition_room: true,
        was_changed_recently: false,
    };
    let empty = RoomHistory { num_assets: 0, is_transition_room: false, ..held };
    let mut stream = Stream::new(1, &[]);
    let (room, weights) = sample_evolved_room(&[held, empty], &Parameters::default(), &mut stream);
    assert_eq!((room, weights), (None, vec![0.0, 0.0]));
}

/// One kitchen, two bedrooms: scores by hand.
#[test]
fn scores_tell_unique_categories_from_common_ones() {
    let of = |category, room| Candidate { category, room };
    let candidates = [of("Mug", 0), of("Bed", 1), of("Bed", 2), of("Book", 1), of("Book", 1)];
    assert_eq!(target_scores(&candidates), [2.0, 1.5, 1.5, 1.0, 1.0]);
    let bias = GoalBias { changed_room: Some(1), previous_goal_rooms: &[2], ..GoalBias::default() };
    let weights = goal_room_weights(
        &candidates,
        &target_scores(&candidates),
        3,
        bias,
        &Parameters::default(),
    );
    assert_eq!(weights, [2.0, 31.5, 1.5 * 0.2]);
    let bias = GoalBias { previous_goal_rooms: &[2, 0, 2], ..GoalBias::default() };
    let weights = goal_room_weights(
        &candidates,
        &target_scores(&candidates),
        3,
        bias,
        &Parameters::default(),
    );
    assert_eq!(weights, [2.0 * 0.2, 3.5, 1.5 * 0.2 * 0.2]);
}

#[test]
fn goals_are_drawn_room_first_and_what_moved_as_often_as_its_weight_says() {
    let of = |category, room| Candidate { category, room };
    let candidates = [of("Mug", 0), of("Bed", 1), of("Lamp", 1), of("Sofa", 1), of("Vase", 1)];
    for (moved_children_multiplier, weights) in
        [(1.0, [1.0, 9.0, 1.0, 1.0]), (4.0, [1.0, 9.0, 1.0, 4.0]), (9.0, [1.0, 9.0, 1.0, 9.0])]
    {
        let parameters = Parameters { moved_children_multiplier, ..Parameters::default() };
        let bias = GoalBias {
            changed_room: Some(1),
            previous_goal_rooms: &[0],
            moved_object: Some(2),
            moved_children: &[4],
        };
        let mut stream = Stream::new(3, &["goals"]);
        let mut counts = [0; 5];
        for _ in 0..NUM_DRAWS {
            let drawn = sample_goal(&candidates, 2, bias, &parameters, &mut stream, |_| Some(()));
            counts[drawn.unwrap().0] += 1;
        }
        let (kitchen, bedroom) = (2.0 * 0.2, 8.0 * 9.0);
        let total: f64 = weights.iter().sum();
        let mut expected = vec![kitchen / (kitchen + bedroom)];
        expected.extend(weights.map(|w| bedroom / (kitchen + bedroom) * w / total));
        assert!(chi_square(&counts, &expected) < 18.5, "{counts:?}");
    }
}

proptest! {
    /// The weight is the paper's product, written with its indicator sums.
    #[test]
    fn room_weight_is_the_papers_product(
        num_assets in 0_usize..200,
        flags in any::<[bool; 3]>(),
        visited_factor in 0.0..10.0,
        changed_factor in 0.0..10.0,
    ) {
        let [is_visited, is_transition_room, was_changed_recently] = flags;
        let room = RoomHistory { num_assets, is_visited, is_transition_room, was_changed_recently };
        let parameters = Parameters {
            visited_factor,
            recently_changed_factor: changed_factor,
            ..Parameters::default()
        };
        let indicator = |flag: bool| f64::from(u8::from(flag));
        let visited = visited_factor * indicator(is_visited) + (1.0 - indicator(is_visited));
        let current = 1.0 - indicator(is_transition_room);
        let evolved = changed_factor * indicator(was_changed_recently)
            + (1.0 - indicator(was_changed_recently));
        let expected = num_assets as f64 * visited * current * evolved;
        prop_assert!((evolved_room_weight(room, &parameters) - expected).abs() < 1e-9);
    }

    /// Every candidate is offered once, and refusing all of them ends the draw.
    #[test]
    fn refused_goals_are_never_drawn_again(
        rooms in vec(0_usize..4, 0..30),
        seed in any::<u64>(),
        num_refused in 0_usize..40,
    ) {
        let candidates: Vec<_> =
            rooms.iter().map(|&room| Candidate { category: "Chair", room }).collect();
        let mut offered = Vec::new();
        let drawn = sample_goal(
            &candidates, 4, GoalBias::default(), &Parameters::default(),
            &mut Stream::new(seed, &["goal"]),
            |index| { offered.push(index); (offered.len() > num_refused).then_some(()) },
        );
        let mut distinct = offered.clone();
        distinct.sort_unstable();
        distinct.dedup();
        prop_assert_eq!(distinct.len(), offered.len());
        prop_assert_eq!(drawn.is_some(), candidates.len() > num_refused);
        prop_assert_eq!(offered.len(), candidates.len().min(num_refused + 1));
    }
}
