//! Sample the object that is the next target (paper, Sec. 3.2).

use crate::{generation::Parameters, rng::Stream};

/// An object that may become a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Candidate<'a> {
    /// Category of the object.
    pub category: &'a str,
    /// Index of its room.
    pub room: usize,
}

/// Compute the target scores: 2 if the category is unique in the house, 1.5 if unique in its room,
/// 1 otherwise.
pub fn target_scores(candidates: &[Candidate<'_>]) -> Vec<f64> {
    let count = |is_counted: &dyn Fn(&Candidate<'_>) -> bool| {
        candidates.iter().filter(|&other| is_counted(other)).count()
    };
    let score = |one: &Candidate<'_>| {
        if count(&|other| other.category == one.category) == 1 {
            2.0
        } else if count(&|other| other.category == one.category && other.room == one.room) == 1 {
            1.5
        } else {
            1.0
        }
    };
    candidates.iter().map(score).collect()
}

/// The biases of the choice of a goal.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct GoalBias<'a> {
    /// Room that was modified for this stage.
    pub changed_room: Option<usize>,
    /// Goal rooms of the last [`Parameters::goal_room_window`] stages. By default only the previous
    /// one counts, though the generation state has two (paper, Sec. 3.2 against Sec. A.2).
    pub previous_goal_rooms: &'a [usize],
    /// Candidate that `SALIENT_OBJECT` moved for this stage.
    pub moved_object: Option<usize>,
    /// Candidates that stood on the moved object and moved with it.
    pub moved_children: &'a [usize],
}

/// Compute the goal weight of each of `num_rooms` rooms: the sum of its candidates' scores, times
/// the biases.
pub fn goal_room_weights(
    candidates: &[Candidate<'_>],
    scores: &[f64],
    num_rooms: usize,
    bias: GoalBias<'_>,
    parameters: &Parameters,
) -> Vec<f64> {
    let mut weights = vec![0.0; num_rooms];
    for (candidate, score) in candidates.iter().zip(scores) {
        if let Some(weight) = weights.get_mut(candidate.room) {
            *weight += score;
        }
    }
    for (room, weight) in weights.iter_mut().enumerate() {
        if bias.changed_room == Some(room) {
            *weight *= parameters.changed_room_multiplier;
        }
        for _ in bias.previous_goal_rooms.iter().filter(|&&earlier| earlier == room) {
            *weight *= parameters.previous_goal_room_multiplier;
        }
    }
    weights
}

/// Draw candidates without replacement, room first, until one is accepted.
///
/// # Arguments
/// * `accept` - returns a value to accept the candidate, or `None` to draw another one.
///
/// # Returns
/// Index of the accepted candidate and the value of `accept`; `None` if every candidate with a
/// positive weight was rejected.
pub fn sample_goal<T>(
    candidates: &[Candidate<'_>],
    num_rooms: usize,
    bias: GoalBias<'_>,
    parameters: &Parameters,
    stream: &mut Stream,
    mut accept: impl FnMut(usize) -> Option<T>,
) -> Option<(usize, T)> {
    let scores = target_scores(candidates);
    let mut room_weights = goal_room_weights(candidates, &scores, num_rooms, bias, parameters);
    let mut object_weights = vec![1.0; candidates.len()];
    for &child in bias.moved_children {
        if let Some(weight) = object_weights.get_mut(child) {
            *weight = parameters.moved_children_multiplier;
        }
    }
    if let Some(weight) = bias.moved_object.and_then(|i| object_weights.get_mut(i)) {
        *weight = parameters.moved_object_multiplier;
    }
    while let Some(room) = stream.choose_weighted(&room_weights) {
        let in_room: Vec<f64> = candidates
            .iter()
            .zip(&object_weights)
            .map(|(candidate, &weight)| if candidate.room == room { weight } else { 0.0 })
            .collect();
        // The room of a rejected candidate is drawn from again until it has no candidate left: the
        // paper "samples another target" without saying from which room (Sec. A.4).
        let Some(index) = stream.choose_weighted(&in_room) else {
            room_weights[room] = 0.0;
            continue;
        };
        if let Some(accepted) = accept(index) {
            return Some((index, accepted));
        }
        object_weights[index] = 0.0;
    }
    None
}
