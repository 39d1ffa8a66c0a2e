//! The body of an ascii PLY file. An element stands on a line of its own; some programs write it on
//! two.

use std::str::{Lines, SplitAsciiWhitespace};

use ply_rs_bw::ply::{ElementDef, Property, PropertyAccess, PropertyAccessResult, PropertyType};

use super::decode::number;
use super::error::{Malformed, Place, malformed};

/// The lines after the header.
pub(super) struct Body<'a> {
    lines: Lines<'a>,
    tokens: SplitAsciiWhitespace<'a>,
    /// Of the tokens, counted from 1.
    line: usize,
    /// The first line that ended within an element.
    pub(super) broken: Option<Place>,
}

impl<'a> Body<'a> {
    /// `header`: how many lines stood before.
    pub(super) fn new(text: &'a str, header: usize) -> Self {
        let (lines, tokens) = (text.lines(), "".split_ascii_whitespace());
        Self { lines, tokens, line: header, broken: None }
    }

    pub(super) fn place(&self) -> Place {
        Place::Line(self.line)
    }

    /// Where the first line stands that no element has taken, if it has anything.
    pub(super) fn left(&self) -> Option<Place> {
        let more = self.lines.clone().position(|line| !line.trim().is_empty())?;
        Some(Place::Line(self.line + more + 1))
    }

    /// The next element. Values after it are ignored if it stands on one line; if it does not, they
    /// say that values are missing somewhere.
    pub(super) fn element<E: PropertyAccess>(
        &mut self,
        definition: &ElementDef,
    ) -> Result<E, Malformed> {
        self.advance(definition)?;
        let first = self.line;
        let mut element = E::new();
        for (name, property) in &definition.properties {
            let value = match &property.data_type {
                PropertyType::Scalar(_) => Property::Double(self.number(definition)?),
                PropertyType::List(..) => {
                    let count = self.count(definition)?;
                    // No count from the file reserves memory.
                    let mut list = Vec::new();
                    for _ in 0..count {
                        list.push(self.count(definition)?);
                    }
                    Property::ListUInt(list)
                }
            };
            if element.set_property(name, value) == PropertyAccessResult::UnsupportedType {
                return malformed(self.place(), format!("property {name} has another type"));
            }
        }
        if self.line > first {
            self.broken.get_or_insert(Place::Line(first));
            let left = self.tokens.clone().count();
            if left > 0 {
                let cause = format!(
                    "{left} values are left after an element {} that began in line {first}",
                    definition.name
                );
                return malformed(self.place(), cause);
            }
        }
        Ok(element)
    }

    /// Goes on to the next line that is not empty, or fails.
    fn advance(&mut self, definition: &ElementDef) -> Result<(), Malformed> {
        for text in self.lines.by_ref() {
            self.line += 1;
            self.tokens = text.split_ascii_whitespace();
            if self.tokens.clone().next().is_some() || definition.properties.is_empty() {
                return Ok(());
            }
        }
        let cause = format!("the file ends before all of element {}", definition.name);
        malformed(self.place(), cause)
    }

    fn token(&mut self, definition: &ElementDef) -> Result<&'a str, Malformed> {
        loop {
            if let Some(token) = self.tokens.next() {
                return Ok(token);
            }
            self.advance(definition)?;
        }
    }

    fn number(&mut self, definition: &ElementDef) -> Result<f64, Malformed> {
        let token = self.token(definition)?;
        number(token).ok_or_else(|| Malformed {
            place: self.place(),
            cause: format!("{token:?} is not a number"),
        })
    }

    fn count(&mut self, definition: &ElementDef) -> Result<u32, Malformed> {
        let token = self.token(definition)?;
        token.parse().or_else(|_| malformed(self.place(), format!("{token:?} is not an index")))
    }
}
