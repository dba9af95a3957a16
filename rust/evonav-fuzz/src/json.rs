//! Mutate JSON by its structure, so that most results are read.

use std::sync::OnceLock;

use libfuzzer_sys::fuzzer_mutate;
use serde_json::{Map, Value, json};

/// Words of the formats, in libFuzzer's own notation.
const DICTIONARY: &str = include_str!("../words.dict");
const MAX_CHANGES: usize = 4;

/// A sequence of random numbers (SplitMix64).
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    fn word(&mut self) -> &'static str {
        static ENTRIES: OnceLock<Vec<&str>> = OnceLock::new();
        let quoted = |line: &'static str| line.strip_prefix('"')?.strip_suffix('"');
        let entries = ENTRIES.get_or_init(|| DICTIONARY.lines().filter_map(quoted).collect());
        entries[self.below(entries.len())]
    }
}

/// The way to change a document.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Any change; half of the mutations are libFuzzer's own, of bytes.
    Wild,
    /// Changes after which most documents are still read: types are kept, and most numbers and names are
    /// changed wherever they occur.
    Tame,
}

/// Mutate a text in place and return its new length. A text that is not JSON is left to libFuzzer.
pub fn mutate(data: &mut [u8], len: usize, max_len: usize, seed: u32, way: Way) -> usize {
    let mut draws = Draws(u64::from(seed));
    if (way == Way::Tame || draws.below(2) == 0)
        && let Some(text) = mutated(&data[..len], way, &mut draws)
        && text.len() <= max_len
    {
        data[..text.len()].copy_from_slice(&text);
        return text.len();
    }
    fuzzer_mutate(data, len, max_len)
}

/// Mutate a weights file, whose header is JSON with its length in front, as [`mutate`].
pub fn mutate_weights(data: &mut [u8], len: usize, max_len: usize, seed: u32) -> usize {
    let mut draws = Draws(u64::from(seed));
    if draws.below(2) == 0
        && let Some((magic, rest)) = data[..len].split_at_checked(8)
        && let Some((header_len, rest)) = rest.split_first_chunk()
        && let Some((header, numbers)) =
            rest.split_at_checked(u32::from_le_bytes(*header_len) as usize)
        && let Some(header) = mutated(header, Way::Wild, &mut draws)
    {
        let header_len = (header.len() as u32).to_le_bytes();
        let file = [magic, &header_len, &header, numbers].concat();
        if file.len() <= max_len {
            data[..file.len()].copy_from_slice(&file);
            return file.len();
        }
    }
    fuzzer_mutate(data, len, max_len)
}

/// Return a changed document; `None` if the text is not JSON.
fn mutated(text: &[u8], way: Way, draws: &mut Draws) -> Option<Vec<u8>> {
    let mut document: Value = serde_json::from_slice(text).ok()?;
    for _ in 0..=draws.below(MAX_CHANGES) {
        change(&mut document, way, draws);
    }
    serde_json::to_vec(&document).ok()
}

/// Change a random value of a document. Most numbers and names are changed wherever they occur, so that
/// walls stay rectangles and references are kept.
fn change(document: &mut Value, way: Way, draws: &mut Draws) {
    let num = count(document);
    let other = nth(document, &mut draws.below(num)).map(|value| value.clone());
    let Some(target) = nth(document, &mut draws.below(num)) else { return };
    let old = target.clone();
    let num_kinds = if way == Way::Tame { 128 } else { 8 };
    match (draws.below(num_kinds), &mut *target) {
        (0, _) => *target = other.unwrap_or_default(),
        (1, _) => *target = special(draws),
        (_, Value::Number(number)) => *target = near(number.as_f64().unwrap_or(0.0), draws),
        (_, Value::Bool(flag)) => *flag = !*flag,
        (_, Value::String(text)) => *text = renamed(text, other.as_ref(), draws),
        (_, Value::Array(list)) => change_list(list, other, way, draws),
        (kind, Value::Object(map)) if way == Way::Wild || kind < 16 => {
            change_map(map, other, draws);
        }
        (_, Value::Object(_)) => {}
        (_, Value::Null) => *target = other.unwrap_or_default(),
    }
    let new = target.clone();
    if (old.is_number() || old.is_string()) && draws.below(4) != 0 {
        replace(document, &old, &new);
    }
}

/// Replace a value wherever it occurs.
fn replace(value: &mut Value, old: &Value, new: &Value) {
    match value {
        value if value == old => *value = new.clone(),
        Value::Array(list) => list.iter_mut().for_each(|entry| replace(entry, old, new)),
        Value::Object(map) => map.values_mut().for_each(|entry| replace(entry, old, new)),
        _ => {}
    }
}

fn count(value: &Value) -> usize {
    1 + match value {
        Value::Array(list) => list.iter().map(count).sum(),
        Value::Object(map) => map.values().map(count).sum(),
        _ => 0,
    }
}

/// Return the value before which `left` others come, depth first.
fn nth<'a>(value: &'a mut Value, left: &mut usize) -> Option<&'a mut Value> {
    if *left == 0 {
        return Some(value);
    }
    *left -= 1;
    match value {
        Value::Array(list) => list.iter_mut().find_map(|entry| nth(entry, left)),
        Value::Object(map) => map.values_mut().find_map(|entry| nth(entry, left)),
        _ => None,
    }
}

fn special(draws: &mut Draws) -> Value {
    match draws.below(10) {
        0 => Value::Null,
        1 => json!(true),
        2 => json!([]),
        3 => json!({}),
        4 => json!(1e308),
        5 => json!(-1e-308),
        6 => json!(u64::MAX),
        7 => json!(i64::MIN),
        8 => json!("é|\u{0}".repeat(draws.below(300))),
        _ => json!(draws.word()),
    }
}

fn near(value: f64, draws: &mut Draws) -> Value {
    let unit = draws.below(2001) as f64 / 1000.0 - 1.0;
    json!(match draws.below(8) {
        0 => -value,
        1 => value + 1e-9 * unit,
        2 => value + 0.01 * unit,
        3 => value * (1.0 + unit),
        4 => value.round(),
        5 => 90.0 * draws.below(9) as f64,
        6 => 12.0 * unit,
        _ => value + unit,
    })
}

fn renamed(text: &str, other: Option<&Value>, draws: &mut Draws) -> String {
    match (draws.below(4), other) {
        (0, Some(Value::String(other))) => other.clone(),
        (0, _) => format!("{text}{}", draws.below(10)),
        (1, _) => text.chars().take(draws.below(text.len() + 1)).collect(),
        _ => draws.word().to_owned(),
    }
}

fn change_list(list: &mut Vec<Value>, other: Option<Value>, way: Way, draws: &mut Draws) {
    let at = draws.below(list.len());
    match draws.below(5) {
        0 if way == Way::Wild => list.extend(other),
        _ if list.is_empty() => list.extend(other),
        1 => drop(list.remove(at)),
        2 => list.swap(at, 0),
        // A copy with an id of its own, or else all copies would be refused.
        _ => {
            let mut copy = list[at].clone();
            if let Some(Value::String(id)) = copy.get_mut("id") {
                *id = format!("{id}{}", draws.below(1000));
            }
            list.push(copy);
        }
    }
}

fn change_map(map: &mut Map<String, Value>, other: Option<Value>, draws: &mut Draws) {
    let key = map.keys().nth(draws.below(map.len())).cloned();
    match (draws.below(3), key) {
        (0, Some(key)) => drop(map.shift_remove(&key)),
        (1, Some(key)) => {
            let value = map.shift_remove(&key).unwrap_or_default();
            map.insert(draws.word().to_owned(), value);
        }
        _ => {
            let value =
                if draws.below(2) == 0 { special(draws) } else { other.unwrap_or_default() };
            map.insert(draws.word().to_owned(), value);
        }
    }
}
