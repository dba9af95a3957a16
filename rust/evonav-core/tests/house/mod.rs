//! Reading, checking and changing houses.

mod delta;
mod malformed;
mod parse;
