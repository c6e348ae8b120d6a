//! What of a glTF file is lost or made up, told once a kind.

use std::{borrow::Cow, path::Path};

use manylight_graph::diagnostics::Diagnostics;

use crate::import::nowhere;

/// One kind of loss.
struct Loss {
    message: Cow<'static, str>,
    help: &'static str,
    /// Where it is met first, as a path inside the file.
    first: String,
    count: usize,
}

/// The losses of one file.
#[derive(Default)]
pub(super) struct Losses(Vec<Loss>);

impl Losses {
    /// Counts a loss at a path such as `materials[3].normalTexture`; `message` says what becomes of it and tells the kinds apart.
    pub(super) fn add(&mut self, at: impl Into<String>, message: impl Into<Cow<'static, str>>, help: &'static str) {
        let message = message.into();
        match self.0.iter_mut().find(|loss| loss.message == message) {
            Some(loss) => loss.count += 1,
            None => self.0.push(Loss { message, help, first: at.into(), count: 1 }),
        }
    }

    /// Whether a message of this beginning was told.
    pub(super) fn has(&self, start: &str) -> bool {
        self.0.iter().any(|loss| loss.message.starts_with(start))
    }

    /// A warning for each kind.
    pub(super) fn report(self, path: &Path, warnings: &mut Diagnostics) {
        for Loss { message, help, first, count } in self.0 {
            let more = if count > 1 { format!(" ({count} times, the first is told)") } else { String::new() };
            let warning = nowhere(format!("`{}`: {first}: {message}{more}", path.display()));
            warnings.0.push(if help.is_empty() { warning } else { warning.help(help) });
        }
    }
}
