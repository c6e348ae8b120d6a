//! The command line `manylight`.

mod cli;
mod commands;
mod progress;
mod trace;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let cli = match cli::Cli::try_parse() {
        Ok(cli) => cli,
        Err(message) => {
            // Help and version come here, too, with code 0. Nobody can be told when even that cannot be printed.
            let _ = message.print();
            return ExitCode::from(u8::try_from(message.exit_code()).unwrap_or(2));
        }
    };
    match commands::run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(fault) => {
            let text = fault.render();
            if !text.is_empty() {
                eprintln!("{}", text.trim_end());
            }
            ExitCode::from(fault.exit_code())
        }
    }
}
