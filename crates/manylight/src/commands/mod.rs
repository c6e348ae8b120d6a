//! One module a subcommand.

mod compare;

use std::io::{self, Write};

use manylight::fault::Fault;

/// Prints to the standard output; a reader that has gone away (`| head`) is no fault.
pub fn print(text: &str) -> Result<(), Fault> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Fault::Input(format!("cannot write to the standard output: {e}"))),
        _ => Ok(()),
    }
}
