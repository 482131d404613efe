//! Reading JSON with errors that name the place: every value knows its path, every object knows which
//! keys were asked for and refuses the others.

use std::cell::RefCell;

use serde_json::{Map, Value};

use crate::error::{Error, ErrorKind, Result};
use crate::likeness::edits;
use crate::trace::math::{Vec3, direction};

/// A value and its path.
#[derive(Debug, Clone)]
pub struct Node<'a> {
    value: &'a Value,
    path: String,
}

/// An object whose keys are being read.
#[derive(Debug)]
pub struct Object<'a> {
    map: &'a Map<String, Value>,
    path: String,
    known: RefCell<Vec<&'static str>>,
}

fn kind_of(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    }
}

impl<'a> Node<'a> {
    /// The whole document.
    pub fn root(value: &'a Value) -> Self {
        Self { value, path: "$".into() }
    }

    /// An error at this place.
    pub fn error(&self, what: impl AsRef<str>) -> Error {
        Error::new(ErrorKind::Unreadable, format!("at {}: {}", self.path, what.as_ref()))
    }

    fn expected(&self, what: &str) -> Error {
        self.error(format!("got {} where {what} was expected", kind_of(self.value)))
            .remedy("see docs/SCENES.md for every field")
    }

    /// The value as an object.
    pub fn object(&self) -> Result<Object<'a>> {
        let map = self.value.as_object().ok_or_else(|| self.expected("an object"))?;
        Ok(Object { map, path: self.path.clone(), known: RefCell::default() })
    }

    /// The members of an object of any keys, in the order of the keys.
    pub fn members(&self) -> Result<Vec<(&'a str, Node<'a>)>> {
        let map = self.value.as_object().ok_or_else(|| self.expected("an object"))?;
        let node = |(key, value): (&'a String, &'a Value)| {
            (key.as_str(), Node { value, path: format!("{}.{key}", self.path) })
        };
        Ok(map.iter().map(node).collect())
    }

    /// The members of a list.
    pub fn list(&self) -> Result<Vec<Node<'a>>> {
        let list = self.value.as_array().ok_or_else(|| self.expected("a list"))?;
        Ok(list
            .iter()
            .enumerate()
            .map(|(i, value)| Node { value, path: format!("{}[{i}]", self.path) })
            .collect())
    }

    /// Whether the value is an object.
    pub fn is_object(&self) -> bool {
        self.value.is_object()
    }

    /// A string.
    pub fn string(&self) -> Result<&'a str> {
        self.value.as_str().ok_or_else(|| self.expected("a string"))
    }

    /// True or false.
    pub fn bool(&self) -> Result<bool> {
        self.value.as_bool().ok_or_else(|| self.expected("true or false"))
    }

    /// A finite number.
    pub fn number(&self) -> Result<f64> {
        let number = self.value.as_f64().filter(|x| (*x as f32).is_finite());
        number.ok_or_else(|| self.expected("a number within single precision"))
    }

    /// A finite number from `least` to `greatest`.
    pub fn number_in(&self, least: f64, greatest: f64) -> Result<f32> {
        let number = self.number()?;
        if (least..=greatest).contains(&number) {
            return Ok(number as f32);
        }
        let range = match greatest == f64::INFINITY {
            true => format!("at least {least}"),
            false => format!("{least} to {greatest}"),
        };
        Err(self.error(format!("{number} is out of range")).remedy(format!("give a number of {range}")))
    }

    /// A positive number.
    pub fn positive(&self) -> Result<f32> {
        let number = self.number_in(0.0, f64::INFINITY)?;
        if number > 0.0 {
            return Ok(number);
        }
        Err(self.error("0 is out of range").remedy("give a positive number"))
    }

    /// A whole number from `least` to `greatest`.
    pub fn whole(&self, least: u64, greatest: u64) -> Result<u64> {
        let number = self.value.as_u64().filter(|n| (least..=greatest).contains(n));
        number.ok_or_else(|| self.expected(&format!("a whole number of {least} to {greatest}")))
    }

    /// A list of exactly `N` numbers.
    pub fn numbers<const N: usize>(&self) -> Result<[f64; N]> {
        let list = self.value.as_array().filter(|list| list.len() == N);
        list.ok_or_else(|| self.expected(&format!("a list of {N} numbers")))?;
        let numbers = self.list()?.iter().map(Node::number).collect::<Result<Vec<_>>>()?;
        Ok(std::array::from_fn(|i| numbers[i]))
    }

    /// A point or direction.
    pub fn vec3(&self) -> Result<Vec3> {
        Ok(Vec3::from(self.numbers::<3>()?.map(|x| x as f32)))
    }

    /// A direction other than zero, made of unit length.
    pub fn unit(&self) -> Result<Vec3> {
        let unit = direction(self.numbers::<3>()?.into());
        unit.ok_or_else(|| self.error("the direction is zero").remedy("give a direction"))
    }

    /// Linear RGB, or one number for all three; every channel from 0 to `greatest`.
    pub fn color(&self, greatest: f64) -> Result<Vec3> {
        if self.value.is_number() {
            return Ok(Vec3::repeat(self.number_in(0.0, greatest)?));
        }
        let list = self.value.as_array().filter(|list| list.len() == 3);
        list.ok_or_else(|| self.expected("a colour [r, g, b] or one number"))?;
        let channels = self.list()?.iter().map(|c| c.number_in(0.0, greatest)).collect::<Result<Vec<_>>>()?;
        Ok(Vec3::new(channels[0], channels[1], channels[2]))
    }

    /// Radiance or irradiance per channel: its square, of which variances are made, stays single precision.
    pub fn radiance(&self) -> Result<Vec3> {
        self.color(1e15)
    }

    /// One of several names.
    pub fn choice<T: Copy>(&self, choices: &[(&str, T)]) -> Result<T> {
        let name = self.string()?;
        if let Some((_, value)) = choices.iter().find(|(known, _)| *known == name) {
            return Ok(*value);
        }
        let names: Vec<&str> = choices.iter().map(|(known, _)| *known).collect();
        Err(self.error(format!("'{name}' is not known here")).remedy(nearest(name, &names)))
    }
}

impl<'a> Object<'a> {
    /// The value of `key`, if it is there.
    pub fn get(&self, key: &'static str) -> Option<Node<'a>> {
        self.known.borrow_mut().push(key);
        self.map.get(key).map(|value| Node { value, path: format!("{}.{key}", self.path) })
    }

    /// The value of `key`.
    pub fn need(&self, key: &'static str) -> Result<Node<'a>> {
        self.get(key).ok_or_else(|| {
            Error::new(ErrorKind::Unreadable, format!("at {}: '{key}' is missing", self.path))
                .remedy(format!("add it{}; see docs/SCENES.md", self.slip(key)))
        })
    }

    /// A hint at a key that was perhaps meant to be `key`.
    fn slip(&self, key: &str) -> String {
        let known = self.known.borrow();
        let others = self.map.keys().map(String::as_str).filter(|other| !known.contains(other));
        let close = others.map(|other| (edits(key, other), other)).min();
        let close = close.filter(|(edits, _)| *edits <= 1 + key.len() / 3);
        close.map_or(String::new(), |(_, other)| format!(", or is '{other}' meant to be it?"))
    }

    /// The value of `key` through `read`, or `default` without it.
    pub fn or<T>(&self, key: &'static str, default: T, read: impl Fn(&Node<'a>) -> Result<T>) -> Result<T> {
        self.get(key).map_or(Ok(default), |node| read(&node))
    }

    /// Refuses keys that were not asked for.
    pub fn done(&self) -> Result<()> {
        let known = self.known.borrow();
        match self.map.keys().find(|key| !known.contains(&key.as_str())) {
            None => Ok(()),
            Some(key) => Err(Error::new(
                ErrorKind::Unreadable,
                format!("at {}: the key '{key}' is not known here", self.path),
            )
            .remedy(nearest(key, &known))),
        }
    }
}

/// A hint at the name that was probably meant.
fn nearest(name: &str, known: &[&str]) -> String {
    let close = known.iter().map(|k| (edits(name, k), *k)).min();
    match close {
        Some((edits, meant)) if edits <= 1 + name.len() / 3 => format!("did you mean '{meant}'?"),
        Some(_) => format!("known are: {}", known.join(", ")),
        None => "add it: none is defined".into(),
    }
}
