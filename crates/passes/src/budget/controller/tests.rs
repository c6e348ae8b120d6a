//! Loads that do not exist, against what the module promises.

use proptest::prelude::*;

use super::*;

/// A machine on which a frame takes what `time` says, from the rung and the number of the frame.
struct Machine {
    controller: Controller,
    frames: usize,
    steps: Vec<(usize, Step)>,
}

impl Machine {
    fn new(budget_ms: f64, rungs: usize) -> Self {
        Self { controller: Controller::new(budget_ms, rungs, Tuning::default()), frames: 0, steps: Vec::new() }
    }

    fn run(&mut self, frames: usize, mut time: impl FnMut(usize, usize) -> f64) -> &mut Self {
        for _ in 0..frames {
            let ms = time(self.controller.rung(), self.frames);
            self.steps.extend(self.controller.observe(ms).map(|step| (self.frames, step)));
            self.frames += 1;
        }
        self
    }

    fn rung(&self) -> usize {
        self.controller.rung()
    }
}

/// Eight rungs, of which each takes four fifths of the one before.
fn ladder(rung: usize) -> f64 {
    (0..rung).fold(20.0, |ms, _| ms * 0.8)
}

const RUNGS: usize = 8;

#[test]
fn a_budget_that_is_met_changes_nothing() {
    let mut machine = Machine::new(20.0, RUNGS);
    assert_eq!(machine.run(1000, |rung, _| ladder(rung)).steps, []);
    assert!(machine.controller.is_settled());
}

#[test]
fn an_impossible_budget_ends_on_the_cheapest_rung() {
    let mut machine = Machine::new(0.1, RUNGS);
    machine.run(1000, |rung, _| ladder(rung));
    assert_eq!((machine.rung(), machine.steps.len()), (RUNGS - 1, 1));
    assert!(machine.controller.is_settled());
}

#[test]
fn the_best_rung_that_fits_is_found() {
    for (budget, best) in [(16.5, 1), (13.5, 2), (10.5, 3), (8.5, 4)] {
        let mut machine = Machine::new(budget, RUNGS);
        machine.run(400, |rung, _| ladder(rung));
        assert!(machine.rung() == best, "{budget} ms: rung {}, {:?}", machine.rung(), machine.steps);
        let late = machine.steps.last().expect("a change").0;
        assert!(late < 60, "settled only after {late} frames");
    }
}

/// Where the usual step expects too little of a rung, the better ones are tried afterwards.
#[test]
fn a_jump_too_far_is_taken_back() {
    let times = [40.0, 12.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0];
    let mut machine = Machine::new(14.0, RUNGS);
    machine.run(400, |rung, _| times[rung]);
    assert!(machine.steps[0].1.to > 1, "{:?}", machine.steps);
    assert_eq!(machine.rung(), 1, "{:?}", machine.steps);
}

#[test]
fn a_heavier_scene_is_followed_soon_and_a_lighter_one_gives_quality_back() {
    let mut machine = Machine::new(21.5, RUNGS);
    machine.run(100, |rung, _| ladder(rung)).run(200, |rung, _| 2.0 * ladder(rung));
    let (first, _) = machine.steps[0];
    assert!(first < 100 + 5, "the load rose at 100, the first change was at {first}");
    assert_eq!(machine.rung(), 3, "{:?}", machine.steps);
    let heavy = machine.steps.len();
    machine.run(200, |rung, _| ladder(rung));
    assert_eq!(machine.rung(), 0, "{:?}", machine.steps);
    let (last, _) = machine.steps[machine.steps.len() - 1];
    assert!(last - 300 <= 60, "quality came back after {} frames", last - 300);
    assert!(heavy <= 4 && machine.steps.len() <= 8, "{:?}", machine.steps);
}

#[test]
fn a_ramp_is_followed_without_turning_back() {
    let mut machine = Machine::new(21.5, RUNGS);
    machine.run(2000, |rung, frame| ladder(rung) * (1.0 + frame as f64 / 700.0));
    let turns = machine.steps.windows(2).filter(|pair| pair[0].1.why != pair[1].1.why).count();
    assert!(machine.rung() >= 5 && turns <= 4, "{:?}", machine.steps);
    let before = machine.steps.len();
    machine.run(4000, |rung, frame| ladder(rung) * (1.0 + (2000.0 - (frame - 2000) as f64).max(0.0) / 700.0));
    assert_eq!(machine.rung(), 0, "{:?}", &machine.steps[before..]);
}

#[test]
fn spikes_change_nothing() {
    let mut machine = Machine::new(21.5, RUNGS);
    // Two of five frames, at any place of the block.
    machine.run(5000, |rung, frame| ladder(rung) * if (frame * 2) % 5 < 2 { 50.0 } else { 1.0 });
    assert_eq!(machine.steps, []);
}

/// Two loads in turn: followed at first, and ever more rarely.
#[test]
fn a_load_that_comes_and_goes_is_given_up() {
    for period in [7, 50, 333] {
        let mut machine = Machine::new(21.5, RUNGS);
        let load = |frame: usize| if (frame / period).is_multiple_of(2) { 1.0 } else { 2.2 };
        machine.run(5_000, |rung, frame| ladder(rung) * load(frame));
        let early = machine.steps.len();
        machine.run(95_000, |rung, frame| ladder(rung) * load(frame));
        let late = machine.steps.len() - early;
        assert!(late <= 36 && early <= 64, "period {period}: {early} changes, then {late} in 19 times as many frames");
    }
}

#[test]
fn no_times_are_no_load() {
    let mut machine = Machine::new(21.5, RUNGS);
    machine.run(100, |_, frame| [0.0, f64::NAN, f64::INFINITY, -3.0][frame % 4]);
    assert_eq!((machine.steps.len(), machine.controller.median_ms()), (0, None));
}

#[test]
fn a_rung_that_cannot_be_had_is_passed_over() {
    let mut machine = Machine::new(9.0, 4);
    let times = [20.0, 15.0, 8.0, 4.0];
    let mut tried = Vec::new();
    for _ in 0..400 {
        if let Some(step) = machine.controller.observe(times[machine.controller.rung()]) {
            tried.push(step.to);
            if step.to == 2 {
                machine.controller.undo(step);
            }
        }
    }
    assert_eq!(machine.rung(), 3);
    assert!(tried.iter().filter(|rung| **rung == 2).count() <= 1, "{tried:?}");
}

#[test]
fn another_load_starts_from_the_same_rung() {
    let mut machine = Machine::new(9.0, RUNGS);
    machine.run(400, |rung, _| ladder(rung));
    let rung = machine.rung();
    machine.controller.restart();
    assert_eq!(machine.rung(), rung);
    machine.run(400, |rung, _| ladder(rung) / 4.0);
    assert_eq!(machine.rung(), 0, "{:?}", machine.steps);
}

/// The bound of the module's first promise but one, for a ladder of `rungs`.
fn most_under_noise(rungs: usize) -> usize {
    rungs * (rungs - 1) / 2
}

/// The bound for any times: 2R (k + 1).
fn most_at_all(rungs: usize, frames: usize) -> usize {
    let tuning = Tuning::default();
    let blocks = (frames / tuning.window) as f64;
    let turns = (blocks / tuning.hold as f64 + 1.0).log2() as usize;
    2 * (rungs - 1) * (turns + 1)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    /// Times of rungs may even rise along the ladder.
    #[test]
    fn constant_load_settles(times in prop::collection::vec(1.0f64..100.0, 1..7), budget in 1.0f64..100.0) {
        let mut machine = Machine::new(budget, times.len());
        // Waiting doubles with each rung that fails.
        machine.run(5 * (1 << (times.len() + 3)), |rung, _| times[rung]);
        let rung = machine.rung();
        prop_assert!(machine.steps.len() <= 2 * (times.len() - 1), "{:?}", machine.steps);
        prop_assert!(times[rung] <= budget || rung == times.len() - 1);
        prop_assert!(machine.controller.is_settled());
        let before = machine.steps.len();
        machine.run(5000, |rung, _| times[rung]);
        prop_assert_eq!(machine.steps.len(), before);
    }

    /// Each median is off by as much as is promised, at its worst.
    #[test]
    fn noise_settles(
        times in prop::collection::vec(1.0f64..100.0, 1..7), budget in 1.0f64..100.0,
        noise in prop::collection::vec(-1.0f64..1.0, 64), extreme in any::<bool>(),
    ) {
        let amplitude = Tuning::default().noise() * 0.999;
        let noise = |frame: usize| {
            let share = noise[(frame / 5) % noise.len()];
            1.0 + amplitude * if extreme { share.signum() } else { share }
        };
        let mut machine = Machine::new(budget, times.len());
        machine.run(5 * (1 << (times.len() + 5)), |rung, frame| times[rung] * noise(frame));
        prop_assert!(machine.steps.len() <= most_under_noise(times.len()), "{:?}", machine.steps);
        let before = machine.steps.len();
        machine.run(10_000, |rung, frame| times[rung] * noise(frame));
        prop_assert_eq!(machine.steps.len(), before, "{:?}", machine.steps);
    }

    /// Whatever the times are.
    #[test]
    fn nothing_makes_it_swing(times in prop::collection::vec(0.0f64..3.0, 20..400), spread in 0.0f64..3.0, rungs in 1usize..9) {
        let frames = 40_000;
        let mut machine = Machine::new(20.0, rungs);
        machine.run(frames, |rung, frame| ladder(rung) * times[(frame / 5) % times.len()].powf(spread));
        prop_assert!(machine.steps.len() <= most_at_all(rungs, frames), "{} changes", machine.steps.len());
    }

    /// A load that tries to: light until quality rises, heavy until it falls.
    #[test]
    fn not_even_ill_will_makes_it_swing(rungs in 2usize..9, light in 0.05f64..0.9, heavy in 1.1f64..4.0) {
        let frames = 40_000;
        let mut machine = Machine::new(20.0, rungs);
        let mut is_light = false;
        let mut last = 0;
        machine.run(frames, |rung, _| {
            if rung != last {
                (is_light, last) = (rung > last, rung);
            }
            20.0 * if is_light { light } else { heavy }
        });
        prop_assert!(machine.steps.len() <= most_at_all(rungs, frames), "{} changes", machine.steps.len());
    }

    /// Down to the budget, or to the end of the ladder, within R + 2 blocks after a load has risen.
    #[test]
    fn a_risen_load_is_met_in_time(before in 0.2f64..1.0, after in 1.0f64..6.0, at in 1usize..40, falls in prop::collection::vec(0.3f64..1.0, 1..8)) {
        let time = |rung: usize| falls[..rung].iter().fold(20.0, |ms, fall| ms * fall);
        let mut machine = Machine::new(20.0, falls.len() + 1);
        let is_met = |rung: usize| after * time(rung) <= 20.0 || rung == falls.len();
        machine.run(at, |rung, _| before * time(rung));
        let mut frames = 0;
        while !is_met(machine.rung()) {
            machine.run(1, |rung, _| after * time(rung));
            frames += 1;
            prop_assert!(frames <= 5 * (falls.len() + 2), "rung {}: {:?}", machine.rung(), machine.steps);
        }
    }

    #[test]
    fn the_same_times_give_the_same_rungs(times in prop::collection::vec(1.0f64..100.0, 1..500), budget in 1.0f64..100.0) {
        let mut machines = [(); 2].map(|()| Machine::new(budget, RUNGS));
        for machine in &mut machines {
            machine.run(times.len(), |_, frame| times[frame]);
        }
        prop_assert_eq!(&machines[0].steps, &machines[1].steps);
    }
}
