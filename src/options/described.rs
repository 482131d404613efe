//! Options that describe themselves: what stands at a field is its documentation, its check and its row in
//! docs/OPTIONS.md, so that each is told in one place.

use std::fmt::Display;
use std::ops::RangeInclusive;

use serde::Serialize;

use crate::error::{Error, ErrorKind, Result};

/// An option as tables have it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Key {
    /// What `--set` calls it.
    pub name: String,
    /// Its value as JSON.
    pub value: String,
    /// What it may be, in words; empty where its meaning tells.
    pub range: String,
    /// What it does, in Markdown.
    pub meaning: String,
}

impl Key {
    /// Of a field's documentation the measurements behind its default are left out.
    pub(crate) fn new(
        name: String,
        value: &impl Serialize,
        range: Option<String>,
        kind: &str,
        documentation: &str,
    ) -> Self {
        let meaning = documentation.split("`[choice]`").next().unwrap_or_default().trim();
        let meaning = meaning.strip_suffix('.').unwrap_or(meaning).to_owned();
        let value = serde_json::to_string(value).unwrap_or_default();
        let range = range.unwrap_or_else(|| if kind == "bool" { "true, false" } else { "" }.to_owned());
        Self { name, value, range, meaning }
    }
}

/// The numbers that an option holds.
pub(crate) trait Numbers<N> {
    fn numbers(&self) -> &[N];
}

impl Numbers<usize> for usize {
    fn numbers(&self) -> &[usize] {
        std::slice::from_ref(self)
    }
}

impl Numbers<f32> for f32 {
    fn numbers(&self) -> &[f32] {
        std::slice::from_ref(self)
    }
}

impl Numbers<f32> for Vec<f32> {
    fn numbers(&self) -> &[f32] {
        self
    }
}

impl Numbers<f32> for Option<f32> {
    fn numbers(&self) -> &[f32] {
        self.as_slice()
    }
}

impl<const N: usize> Numbers<f32> for [f32; N] {
    fn numbers(&self) -> &[f32] {
        self
    }
}

/// Checks that all numbers of an option are within its range, which NaN never is.
///
/// # Errors
/// [`ErrorKind::Usage`] names the option, what it is and what it may be.
pub(crate) fn check<N: PartialOrd + Display>(
    name: &str,
    value: &impl Numbers<N>,
    range: &RangeInclusive<N>,
) -> Result<()> {
    let outside = value.numbers().iter().find(|number| !range.contains(number));
    outside.map_or(Ok(()), |number| {
        let what = format!("option '{name}' is {number}");
        Err(Error::new(ErrorKind::Usage, what).remedy(format!("give {}", told(range))))
    })
}

/// A range in words.
pub(crate) fn told<N: Display>(range: &RangeInclusive<N>) -> String {
    format!("{} to {}", range.start(), range.end())
}

/// A struct of options whose fields have `#[range(…)]` behind their documentation where they are numbers.
macro_rules! described {
    (
        $(#[$outer:meta])*
        pub struct $name:ident {
            $(
                $(#[doc = $doc:literal])+
                $(#[range($range:expr)])?
                $(#[serde($($serde:tt)*)])?
                pub $field:ident: $kind:ty,
            )*
        }
    ) => {
        $(#[$outer])*
        pub struct $name {
            $(
                $(#[doc = $doc])+
                $(#[doc = concat!("\n\nIn `", stringify!($range), "`.")])?
                $(#[serde($($serde)*)])?
                pub $field: $kind,
            )*
        }

        impl $name {
            /// The fields, their names behind that of their `group` (with its dot).
            fn fields(&self, group: &str) -> Vec<$crate::options::Key> {
                vec![$({
                    let range: &[String] = &[$($crate::options::told(&($range)))?];
                    let (name, range) = (format!("{group}{}", stringify!($field)), range.first().cloned());
                    $crate::options::Key::new(name, &self.$field, range, stringify!($kind), concat!($($doc),+))
                }),*]
            }

            /// Checks the ranges of the fields, named as by [`Self::fields`].
            fn check_fields(&self, group: &str) -> $crate::error::Result<()> {
                $($(
                    let name = format!("{group}{}", stringify!($field));
                    $crate::options::check(&name, &self.$field, &($range))?;
                )?)*
                Ok(())
            }
        }
    };
}

pub(crate) use described;
