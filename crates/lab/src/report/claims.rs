//! What a sweep claims of two variants, and whether the records bear it out.

use super::{
    study::{Group, Study, stage_times, time_of},
    text::{maybe, number},
};
use crate::{record::Record, sheet::Claim};

/// A sentence or two for each claim on each two runs of a group that are alike but for their variants.
pub(super) fn verdicts(study: &Study<'_>, group: &Group<'_>) -> Vec<String> {
    let mut all = Vec::new();
    for claim in &study.sheet.claims {
        let of = |variant: &str| group.runs.iter().copied().filter(|&run| study.records[run].variant == variant).collect::<Vec<_>>();
        let (ours, theirs) = (of(&claim.variant), of(&claim.than));
        let pairs =
            ours.iter().flat_map(|&a| theirs.iter().filter(move |&&b| alike(&study.records[a], &study.records[b])).map(move |&b| (a, b)));
        let before = all.len();
        all.extend(pairs.map(|(a, b)| verdict(study, a, b, claim)));
        if all.len() == before {
            all.push(format!("{} against {}: there are no two runs to compare.", claim.variant, claim.than));
        }
    }
    all
}

/// Whether two runs have the same seed and the same values of what varies in both.
fn alike(a: &Record, b: &Record) -> bool {
    a.seed == b.seed && a.varied.iter().filter(|knob| b.varied.contains(knob)).all(|knob| a.set.get(knob) == b.set.get(knob))
}

fn verdict(study: &Study<'_>, ours: usize, theirs: usize, claim: &Claim) -> String {
    let time = ratio(study.time(ours), study.time(theirs));
    let best = study.metric().best;
    let distance = |run: usize| study.error(run).map(|error| (error - best).abs());
    let error = ratio(distance(ours), distance(theirs));
    let mut text = format!("{} against {}: ", study.labels[ours], study.labels[theirs]);
    text += &format!("{} of the time, claimed at most {}: {}. ", maybe(time), number(claim.time), word(time, claim.time));
    let metric = study.metric().title;
    text += &format!("{} of the error ({metric}), claimed at most {}: {}.", maybe(error), number(claim.error), word(error, claim.error));
    if time.is_some_and(|time| time > claim.time)
        && let Some((stage, excess)) = blame(&study.records[ours], &study.records[theirs], claim.time)
    {
        text += &format!(" Most of what is too much in a frame is in the stage {stage}: {} ms.", number(excess));
    }
    text
}

fn ratio(ours: Option<f64>, theirs: Option<f64>) -> Option<f64> {
    Some(ours? / theirs.filter(|theirs| *theirs > 0.0)?)
}

fn word(value: Option<f64>, most: f64) -> &'static str {
    match value {
        Some(value) if value <= most => "holds",
        Some(_) => "does not hold",
        None => "undefined",
    }
}

/// The stage that exceeds its share of the claim most, and by how many milliseconds.
fn blame(ours: &Record, theirs: &Record, most: f64) -> Option<(String, f64)> {
    let others = stage_times(theirs);
    let excess = |(stage, time): (String, f64)| {
        let allowed = most * time_of(&stage, &others).unwrap_or(0.0);
        (stage, time - allowed)
    };
    stage_times(ours).into_iter().map(excess).filter(|(_, excess)| *excess > 0.0).max_by(|a, b| a.1.total_cmp(&b.1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        record::tests::example,
        sheet::{Axis, Sheet},
    };

    fn of(records: &[Record], time: f64, error: f64) -> Vec<String> {
        let claim = Claim { variant: "a".into(), than: "b".into(), time, error };
        let sheet = Sheet { metric: "relative_rmse".into(), axis: Axis::Frame, claims: vec![claim], ..Sheet::default() };
        let study = Study::new(&sheet, records);
        study.groups.iter().flat_map(|group| verdicts(&study, group)).collect()
    }

    #[test]
    fn claims_hold_or_not_and_the_stage_to_blame_is_named() {
        let records = [example("a", 16, 6.0, 0.2), example("b", 16, 8.0, 0.1), example("b", 32, 1.0, 0.1)];
        let said = of(&records, 0.5, 1.0);
        // By hand: indirect takes half of 6 ms, of which 0.5 × half of 8 ms is allowed.
        assert_eq!(
            said,
            [
                "a clusters=16 against b clusters=16: 0.750 of the time, claimed at most 0.500: does not hold. 2.00 of the error (RMSE / mean), claimed at most 1.00: \
              does not hold. Most of what is too much in a frame is in the stage indirect: 1.00 ms."
            ]
        );
        let said = of(&records, 0.75, 2.0);
        assert!(said[0].matches(": holds").count() == 2 && !said[0].contains("too much"), "{said:?}");
        assert_eq!(of(&records[..1], 1.0, 1.0), ["a against b: there are no two runs to compare."]);
    }
}
