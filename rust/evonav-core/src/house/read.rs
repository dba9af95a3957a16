//! Read and check a house file.

use crate::{
    Error,
    house::{House, document, parse, validate},
};

impl House {
    /// Read and check a house.
    ///
    /// # Arguments
    /// * `name` - name of the house in errors; usually the file and line.
    /// * `json` - one house, schema 0.0.1 or 1.0.0.
    ///
    /// # Errors
    /// [`Error::House`] naming the object, the field and the value found: for text that is not
    /// JSON or gives a key twice, for missing or ill-typed fields, numbers out of range, polygons
    /// without area, references to rooms or walls that are not there, holes off their wall, and
    /// ids used twice.
    pub fn from_json(name: &str, json: &str) -> Result<Self, Error> {
        Self::from_document(name, document::parse(name, json)?)
    }

    pub(crate) fn from_document(name: &str, document: serde_json::Value) -> Result<Self, Error> {
        let house = parse::view(name, document)?;
        validate::check(&house)?;
        Ok(house)
    }
}
