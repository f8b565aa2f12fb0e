//! The studio without a browser: its jobs under random edits, who is let in, what is refused, and that nobody harms another.

mod client;
mod doors;
mod edits;
mod said;
mod talk;
