//! Everything continuous integration checks: each step with a heading and its time, and a summary at the end.

use std::time::{Duration, Instant};

use crate::{
    demo, docs, package,
    setup::{self, Runner},
    shell::{Shell, Stop, plain},
};

/// How a step ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// All is well; a remark, which may be empty.
    Passed(String),
    /// Something is wrong: what.
    Failed(String),
    /// It did not run: why.
    Skipped(String),
}

impl Outcome {
    /// Passed when the command ended with exit code 0.
    fn of(code: Option<i32>) -> Self {
        match code {
            Some(0) => Self::Passed(String::new()),
            Some(code) => Self::Failed(format!("exit code {code}")),
            None => Self::Failed("it could not start or was killed".to_owned()),
        }
    }
}

impl From<Result<String, Stop>> for Outcome {
    fn from(result: Result<String, Stop>) -> Self {
        match result {
            Ok(remark) => Self::Passed(remark),
            Err(stop) => Self::Failed(stop.message),
        }
    }
}

/// A step that ended.
struct Ended {
    name: &'static str,
    outcome: Outcome,
    time: Duration,
}

/// Runs steps and remembers how they ended.
#[derive(Default)]
struct Steps(Vec<Ended>);

impl Steps {
    fn run(&mut self, name: &'static str, step: impl FnOnce() -> Outcome) {
        println!("\n== {name}");
        let start = Instant::now();
        let outcome = step();
        let time = start.elapsed();
        match &outcome {
            Outcome::Passed(_) => println!("-- {name}: passed in {:.1} s", time.as_secs_f64()),
            Outcome::Failed(why) => println!("-- {name}: FAILED in {:.1} s: {why}", time.as_secs_f64()),
            Outcome::Skipped(why) => println!("-- {name}: skipped: {why}"),
        }
        self.0.push(Ended { name, outcome, time });
    }

    /// A table of all steps, and whether none failed.
    fn summary(&self) -> (String, bool) {
        let mut text = String::from("\n== summary\n");
        for Ended { name, outcome, time } in &self.0 {
            let (word, remark) = match outcome {
                Outcome::Passed(remark) => ("passed", remark),
                Outcome::Failed(why) => ("FAILED", why),
                Outcome::Skipped(why) => ("skipped", why),
            };
            let remark = remark.lines().find(|l| !l.trim().is_empty()).unwrap_or_default();
            text.push_str(format!("{word:<8} {:>7.1} s  {name:<14} {remark}", time.as_secs_f64()).trim_end());
            text.push('\n');
        }
        (text, !self.0.iter().any(|e| matches!(e.outcome, Outcome::Failed(_))))
    }
}

/// Sets up, then runs every step although one before it failed.
pub fn test(shell: &Shell, quick: bool) -> Result<(), Stop> {
    setup::setup(shell, false)?;
    setup::components(shell);
    let runner = setup::test_runner(shell);
    let mut steps = Steps::default();

    steps.run("rustfmt", || Outcome::of(shell.show(&["cargo", "fmt", "--all", "--check"])));
    steps.run("clippy", || Outcome::of(shell.show(&["cargo", "clippy", "--workspace", "--all-targets", "--", "-D", "warnings"])));
    let mut program = None;
    steps.run("build", || {
        if shell.show(&["cargo", "build", "--workspace"]) != Some(0) {
            return Outcome::Failed("the workspace does not build".to_owned());
        }
        shell.manylight("debug").map(|path| program = Some(path)).map(|()| String::new()).into()
    });
    steps.run("tests", || tests(shell, runner));
    if !quick {
        steps.run("doc tests", || doc_tests(shell));
    }
    let built = |step: &dyn Fn(&str) -> Outcome| match &program {
        Some(program) => step(program),
        None => Outcome::Skipped("the build failed".to_owned()),
    };
    steps.run("check", || built(&|program| Outcome::of(shell.show(&[program, "check"]))));
    if !quick {
        steps.run("documentation", || built(&|program| docs::fresh(shell, program).into()));
        let options = demo::Options { size: "256x256".to_owned(), out: "out/demo-256.png".to_owned() };
        steps.run("demo", || built(&|program| demo::render(shell, program, &options).map(|()| String::new()).into()));
        steps.run("cargo deny", || deny(shell));
        steps.run("packages", || package::check(shell).into());
    }

    let (summary, good) = steps.summary();
    print!("{summary}");
    if good { Ok(()) } else { Err(Stop::failed("some checks failed")) }
}

fn tests(shell: &Shell, runner: Runner) -> Outcome {
    let words: &[&str] = match runner {
        Runner::Nextest => &["cargo", "nextest", "run", "--workspace", "--profile", "ci"],
        Runner::Cargo => &["cargo", "test", "--workspace", "--all-targets", "--no-fail-fast"],
    };
    tested(shell, words)
}

fn doc_tests(shell: &Shell) -> Outcome {
    tested(shell, &["cargo", "test", "--doc", "--workspace"])
}

fn tested(shell: &Shell, words: &[&str]) -> Outcome {
    let Some(finished) = shell.tee(words) else {
        return Outcome::of(None);
    };
    let count = count(&plain(&finished.stdout), &plain(&finished.stderr));
    match (finished.success, count.is_empty()) {
        (true, _) => Outcome::Passed(count),
        (false, true) => Outcome::of(finished.code.filter(|c| *c != 0)),
        (false, false) => Outcome::Failed(count),
    }
}

/// How many tests ran: nextest's summary, or the sum of what `cargo test` says of each program.
fn count(stdout: &str, stderr: &str) -> String {
    if let Some(line) = stderr.lines().rev().find(|l| l.trim_start().starts_with("Summary [")) {
        return line.split_once(']').map_or(line, |(_, rest)| rest).trim().to_owned();
    }
    let (mut passed, mut failed, mut ignored, mut any) = (0, 0, 0, false);
    for line in stdout.lines().filter_map(|l| l.trim_start().strip_prefix("test result:")) {
        any = true;
        for part in line.split([';', '.']) {
            let words: Vec<&str> = part.split_whitespace().collect();
            let [number, word] = words.as_slice() else { continue };
            let number: u64 = number.parse().unwrap_or(0);
            match *word {
                "passed" => passed += number,
                "failed" => failed += number,
                "ignored" => ignored += number,
                _ => {}
            }
        }
    }
    if any { format!("{passed} passed, {failed} failed, {ignored} ignored") } else { String::new() }
}

/// Licences, bans and sources offline; advisories only when their database has been fetched.
fn deny(shell: &Shell) -> Outcome {
    if !shell.has(&["cargo", "deny"]) {
        return Outcome::Skipped("cargo-deny is not installed (cargo install cargo-deny --locked)".to_owned());
    }
    let mut words = vec!["cargo", "deny", "--offline", "check", "licenses", "bans", "sources"];
    let home = std::env::var_os("CARGO_HOME").map(std::path::PathBuf::from).or_else(|| std::env::home_dir().map(|h| h.join(".cargo")));
    let database =
        home.map(|h| h.join("advisory-dbs")).and_then(|d| std::fs::read_dir(d).ok()).is_some_and(|mut entries| entries.next().is_some());
    if database {
        words.push("advisories");
    }
    match Outcome::of(shell.show(&words)) {
        Outcome::Passed(_) if !database => Outcome::Passed("without advisories: `cargo deny fetch` gets their database".to_owned()),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_names_every_step_and_fails_with_one() {
        let mut steps = Steps::default();
        steps.run("first", || Outcome::Passed("12 tests".to_owned()));
        assert!(steps.summary().1);
        steps.run("second", || Outcome::Failed("\nbroken\nin two lines".to_owned()));
        steps.run("third", || Outcome::Skipped("not installed".to_owned()));
        let (text, good) = steps.summary();
        assert!(!good);
        let lines: Vec<&str> = text.lines().filter(|l| !l.is_empty()).collect();
        assert_eq!(lines.len(), 4);
        assert!(lines[1].starts_with("passed") && lines[1].ends_with("12 tests"));
        assert!(lines[2].starts_with("FAILED") && lines[2].ends_with("broken"));
        assert!(lines[3].starts_with("skipped") && lines[3].ends_with("not installed"));
    }

    #[test]
    fn nextests_summary_is_the_count() {
        let stderr = "   PASS [ 0.1s] a b\n────────────\n     Summary [   1.310s] 19 tests run: 18 passed, 1 failed, 0 skipped\n        FAIL x\nerror: test run failed\n";
        assert_eq!(count("", stderr), "19 tests run: 18 passed, 1 failed, 0 skipped");
    }

    #[test]
    fn results_of_cargo_test_are_added_up() {
        let stdout = "test result: ok. 3 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.00s\n\
                      test result: FAILED. 2 passed; 1 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.00s\n";
        assert_eq!(count(stdout, ""), "5 passed, 1 failed, 1 ignored");
        assert_eq!(count("nothing", "at all"), "");
    }
}
