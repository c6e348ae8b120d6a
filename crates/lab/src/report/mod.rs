//! Reports of sweeps: from records to plots and tables that say what a variant costs and how far it is from the truth.
//!
//! [`html`] makes one page that needs nothing else, [`markdown`] a short page of the book, [`csv()`] a table for other programs. All three
//! say in words what they leave out.

mod book;
mod claims;
mod figures;
mod fit;
mod front;
mod heading;
mod names;
mod page;
mod papers;
mod pictures;
mod plot;
mod spreadsheet;
mod study;
#[cfg(test)]
mod synthetic;
mod table;
mod tables;
#[cfg(test)]
mod tests;
mod text;

pub use book::{BookPage, markdown};
pub use front::pareto;
pub use page::html;
pub use spreadsheet::csv;
