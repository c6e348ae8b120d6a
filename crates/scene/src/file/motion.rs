//! Key frames of scene files.

use std::ops::Range;

use manylight_graph::{
    diagnostics::Diagnostic,
    ron::{Fields, Kind, Reader, Tree, head, suggest},
};

use super::{object::WrittenPose, values::LARGEST};
use crate::motion::{LightPose, Repeat, Track};

/// Key frames as written.
pub(super) struct Keys<T> {
    /// Times, values and places; times increase.
    keys: Vec<(f64, T, Range<usize>)>,
    repeat: Repeat,
}

impl<T> Keys<T> {
    /// The same keys with other values.
    pub(super) fn map<U>(&self, convert: impl Fn(&T) -> U) -> Keys<U> {
        Keys { keys: self.keys.iter().map(|(time, value, place)| (*time, convert(value), place.clone())).collect(), repeat: self.repeat }
    }

    /// The values.
    pub(super) fn values(&self) -> impl Iterator<Item = &T> {
        self.keys.iter().map(|(_, value, _)| value)
    }

    /// The track; `None` if there is no key.
    pub(super) fn track<U>(self, convert: impl Fn(T) -> U) -> Option<Track<U>> {
        Track::keyed(self.keys.into_iter().map(|(time, value, _)| (time, convert(value))).collect(), self.repeat)
    }
}

/// Reads the fields `motion` and `repeat`. `None` without motion, or if it has faults: those stop the scene.
pub(super) fn read_motion<T>(
    reader: &mut Reader,
    fields: &Fields<'_>,
    mut read_key: impl FnMut(&mut Reader, &Tree) -> Option<T>,
) -> Option<Keys<T>> {
    let repeat = fields.get("repeat").map(|tree| (read_repeat(reader, tree), tree));
    let Some(tree) = fields.get("motion") else {
        if let Some((_, tree)) = repeat {
            let span = reader.span(&tree.range);
            reader.out.push(Diagnostic::warning("`repeat` has no effect without `motion`", span).help("remove it, or add key frames"));
        }
        return None;
    };
    let list = reader.list(tree, "key frames");
    if list.is_empty() && matches!(tree.kind, Kind::List(_)) {
        reader.error(&tree.range, "a motion needs a key frame", "write `motion: [(time: 0.0, …), (time: 1.0, …)]`, or leave it out");
    }
    let mut keys: Vec<(f64, T, Range<usize>)> = Vec::with_capacity(list.len());
    for tree in list {
        let value = read_key(reader, tree);
        let (Some(value), Some(time)) = (value, read_time(reader, tree)) else { continue };
        if let Some((before, _, place)) = keys.last()
            && time <= *before
        {
            let (fault, place) = (reader.span(&head(tree)), reader.span(place));
            let message = format!("the time {time} does not come after {before}");
            reader
                .out
                .push(Diagnostic::error(message, fault).and(place, "the key before").help("put the keys in the order of their times"));
            continue;
        }
        keys.push((time, value, head(tree)));
    }
    Some(Keys { keys, repeat: repeat.and_then(|(repeat, _)| repeat).unwrap_or_default() })
}

/// The time of a key; a missing one is reported with the record.
fn read_time(reader: &mut Reader, tree: &Tree) -> Option<f64> {
    let Kind::Record(_, fields) = &tree.kind else { return None };
    let (_, tree) = fields.iter().find(|(name, _)| name.text == "time")?;
    let time = reader.float(tree, "a time in seconds")?;
    if time.abs() > LARGEST {
        reader.error(&tree.range, format!("the time {time} is too large"), "times are in seconds");
        return None;
    }
    Some(time)
}

fn read_repeat(reader: &mut Reader, tree: &Tree) -> Option<Repeat> {
    match &tree.kind {
        Kind::Name(name) | Kind::Text(name) if name == "loop" => Some(Repeat::Loop),
        Kind::Name(name) | Kind::Text(name) if name == "clamp" => Some(Repeat::Clamp),
        Kind::Name(name) | Kind::Text(name) => {
            reader.error(&tree.range, format!("unknown repetition `{name}`"), suggest(name, ["loop", "clamp"]));
            None
        }
        _ => {
            reader.expected(tree, "`loop` or `clamp`", "");
            None
        }
    }
}

/// Warns where a rotation by half a turn or more lies between two keys: it goes the short way round.
pub(super) fn warn_long_turns(reader: &mut Reader, keys: &Keys<WrittenPose>) {
    for pair in keys.keys.windows(2) {
        let [(_, (_, Some((axis, angle))), _), (_, (_, Some((next_axis, next_angle))), place)] = pair else { continue };
        let along = axis.dot(*next_axis);
        if along.abs() > SAME_AXIS && (next_angle * along.signum() - angle).abs() >= 180.0 {
            let message = format!("from {angle}° to {next_angle}° is half a turn or more, and goes the short way round");
            let span = reader.span(place);
            reader.out.push(Diagnostic::warning(message, span).help("put key frames less than 180° apart"));
        }
    }
}

/// Warns where a directional light turns round from one key to the next: the light of a sun that rises and sets without a key at noon.
pub(super) fn warn_opposite_directions(reader: &mut Reader, keys: &Keys<LightPose>) {
    for pair in keys.keys.windows(2) {
        let [(_, pose, _), (_, next, place)] = pair else { continue };
        if pose.target.dot(next.target) < -SAME_AXIS {
            let message = format!("from {} to {} is half a turn: the direction jumps in the middle", pose.target, next.target);
            let span = reader.span(place);
            reader.out.push(Diagnostic::warning(message, span).help("put a key frame between them, on the side where it shall pass"));
        }
    }
}

/// Cosine between axes that count as the same.
const SAME_AXIS: f32 = 0.9999;
