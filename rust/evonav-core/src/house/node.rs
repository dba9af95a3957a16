//! Read JSON values so that every error names the object and the field.

use serde_json::{Map, Value};

use crate::{Error, geometry::Vec3};

/// The step from a value to one that it contains.
#[derive(Clone, Copy)]
enum Step<'a> {
    Key(&'a str),
    Index(usize),
}

/// Field name in errors about a whole entry.
const WHOLE: &str = "(whole)";

/// A JSON value that knows its place in the document. The place costs nothing until an error is
/// created.
#[derive(Clone, Copy)]
pub(super) struct Node<'a> {
    house: &'a str,
    value: &'a Value,
    from: Option<(&'a Node<'a>, Step<'a>)>,
}

/// Largest magnitude of a coordinate: real houses end at 35 m.
pub(super) const MAX_COORDINATE_M: f64 = 200.0;

impl<'a> Node<'a> {
    /// Create the node of the whole document.
    pub(super) fn root(house: &'a str, value: &'a Value) -> Self {
        Self { house, value, from: None }
    }

    /// Create an error about this value.
    pub(super) fn error(&self, message: impl Into<String>) -> Error {
        let (object, field) = self.place();
        Error::House { house: self.house.to_owned(), object, field, message: message.into() }
    }

    /// Create an error that shows the value found.
    pub(super) fn expected(&self, what: &str) -> Error {
        let mut found = self.value.to_string();
        if found.chars().count() > 80 {
            found = found.chars().take(77).chain("...".chars()).collect();
        }
        self.error(format!("is {found}, expected {what}"))
    }

    /// Return the object (the nearest enclosing entry with an id, or its place in the file) and the
    /// dotted field in it.
    fn place(&self) -> (String, String) {
        let mut path = Vec::new();
        let mut node = *self;
        let mut id = None;
        while let Some((holder, step)) = node.from {
            if let (Step::Index(_), Some(own)) =
                (step, node.value.get("id").and_then(Value::as_str))
            {
                id = Some(own.to_owned());
                break;
            }
            path.push(step);
            node = *holder;
        }
        path.reverse();
        let text = |steps: &[Step<'_>]| {
            let mut text = String::new();
            for step in steps {
                match step {
                    Step::Key(key) if text.is_empty() => text.push_str(key),
                    Step::Key(key) => text.extend([".", key]),
                    Step::Index(index) => text.push_str(&format!("[{index}]")),
                }
            }
            text
        };
        if let Some(id) = id {
            return (id, if path.is_empty() { WHOLE.to_owned() } else { text(&path) });
        }
        // An entry of a top-level list that has no id is named by its place.
        let is_entry = matches!(path.as_slice(), [Step::Key(_), Step::Index(_), ..]);
        let (object, field) = path.split_at(if is_entry { 2 } else { 0 });
        let object = if object.is_empty() { "house".to_owned() } else { text(object) };
        (object, if field.is_empty() { WHOLE.to_owned() } else { text(field) })
    }

    fn map(&self) -> Result<&'a Map<String, Value>, Error> {
        self.value.as_object().ok_or_else(|| self.expected("an object"))
    }

    /// Return the node of a value that this one contains.
    fn child<'n>(&'n self, value: &'n Value, step: Step<'n>) -> Node<'n> {
        Node { house: self.house, value, from: Some((self, step)) }
    }

    /// Return the value under `key`; `None` if it is absent or null.
    pub(super) fn maybe<'n>(&'n self, key: &'n str) -> Result<Option<Node<'n>>, Error> {
        let value = self.map()?.get(key).filter(|value| !value.is_null());
        Ok(value.map(|value| self.child(value, Step::Key(key))))
    }

    /// Return the value under `key`, null included.
    pub(super) fn get<'n>(&'n self, key: &'n str) -> Result<Node<'n>, Error> {
        let value = self.map()?.get(key);
        let missing = || self.child(&Value::Null, Step::Key(key)).error("is missing");
        value.map(|value| self.child(value, Step::Key(key))).ok_or_else(missing)
    }

    /// Return the entries of a list that has at most `limit` of them.
    pub(super) fn list(&self, limit: usize) -> Result<impl Iterator<Item = Node<'_>>, Error> {
        let values = self.value.as_array().ok_or_else(|| self.expected("a list"))?;
        if values.len() > limit {
            let found = format!("has {} entries, at most {limit} are read", values.len());
            return Err(self.error(found));
        }
        let entries = values.iter().enumerate();
        Ok(entries.map(|(index, value)| self.child(value, Step::Index(index))))
    }

    /// Return the keys and values of an object that has at most `limit` of them.
    pub(super) fn entries(
        &self,
        limit: usize,
    ) -> Result<impl Iterator<Item = (&'a str, Node<'_>)>, Error> {
        let map = self.map()?;
        if map.len() > limit {
            return Err(self.error(format!("has {} entries, at most {limit} are read", map.len())));
        }
        let entry = |(key, value): (&'a String, &'a Value)| {
            (key.as_str(), self.child(value, Step::Key(key)))
        };
        Ok(map.iter().map(entry))
    }

    /// Return whether the value is null.
    pub(super) fn is_null(&self) -> bool {
        self.value.is_null()
    }

    /// Return the value as a string.
    pub(super) fn text(&self) -> Result<&'a str, Error> {
        self.value.as_str().ok_or_else(|| self.expected("a string"))
    }

    /// Return the value as a non-empty string.
    pub(super) fn name(&self) -> Result<&'a str, Error> {
        match self.text()? {
            "" => Err(self.expected("a name")),
            text if text.len() > 512 => Err(self.expected("a name of at most 512 bytes")),
            text => Ok(text),
        }
    }

    /// Return the value as a boolean.
    pub(super) fn boolean(&self) -> Result<bool, Error> {
        self.value.as_bool().ok_or_else(|| self.expected("true or false"))
    }

    /// Return the value as a finite number within `low..=high`.
    pub(super) fn number(&self, low: f64, high: f64) -> Result<f64, Error> {
        let value = self.value.as_f64().ok_or_else(|| self.expected("a number"))?;
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(self.expected(&format!("a number from {low} to {high}")))
    }

    /// Return the value `{x, y, z}` as a vector, each number within `±limit`.
    pub(super) fn vector(&self, limit: f64) -> Result<Vec3, Error> {
        let axis = |key| self.get(key).and_then(|node| node.number(-limit, limit));
        Ok([axis("x")?, axis("y")?, axis("z")?])
    }

    /// Return the value `{r, g, b}` as a colour, each number in 0..1.
    pub(super) fn colour(&self) -> Result<[f64; 3], Error> {
        let channel = |key| self.get(key).and_then(|node| node.number(0.0, 1.0));
        Ok([channel("r")?, channel("g")?, channel("b")?])
    }

    /// Return the value `{x, y, z}` as a point.
    pub(super) fn point(&self) -> Result<Vec3, Error> {
        self.vector(MAX_COORDINATE_M)
    }
}
