//! Postures as they are asked for on the command line.

use std::str::FromStr;

use crate::numbers::finite;

/// A posture as it is asked for.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum PostureArg {
    /// Where the executor holds the arm.
    Measured,
    /// One with a name.
    Named(String),
    /// Every joint, base to tip.
    Joints(Vec<f64>),
}

impl FromStr for PostureArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_name = |c: char| c.is_ascii_alphanumeric() || "_-. ".contains(c);
        let named =
            text.starts_with(|c: char| c.is_ascii_alphabetic()) && text.chars().all(is_name);
        // `nan` and `inf` are numbers that cannot be, not names.
        if text == "measured" {
            Ok(Self::Measured)
        } else if named && text.parse::<f64>().is_err() {
            Ok(Self::Named(text.to_owned()))
        } else {
            let joint = |part: &str| finite(part.trim()).map_err(|e| format!("`{part}`: {e}"));
            Ok(Self::Joints(text.split(',').map(joint).collect::<Result<_, _>>()?))
        }
    }
}

/// A named posture: NAME=Q1,Q2,….
#[derive(Clone, Debug)]
pub(super) struct NamedPosture(String, Vec<f64>);

impl NamedPosture {
    /// In lower case.
    pub(super) fn name(&self) -> &str {
        &self.0
    }

    /// From base to tip. \[rad\] or \[m\]
    pub(super) fn joints(&self) -> &[f64] {
        &self.1
    }
}

impl FromStr for NamedPosture {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, joints) = text.split_once('=').ok_or("NAME=Q1,Q2,… is wanted")?;
        match joints.parse()? {
            PostureArg::Joints(joints) => Ok(Self(name.to_lowercase(), joints)),
            _ => Err("NAME=Q1,Q2,… is wanted".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_are_told_apart() {
        assert_eq!("HOME".parse(), Ok(PostureArg::Named("HOME".into())));
        assert_eq!("measured".parse(), Ok(PostureArg::Measured));
        assert_eq!("-0.5, 1".parse(), Ok(PostureArg::Joints(vec![-0.5, 1.0])));
        for wrong in ["0,nan,0", "nan", "inf", "", "1,,2", "0.1;0.2"] {
            wrong.parse::<PostureArg>().expect_err(wrong);
        }
        let named: NamedPosture = "Home=0,1".parse().expect("a posture");
        assert_eq!((named.0.as_str(), named.1), ("home", vec![0.0, 1.0]));
        "home".parse::<NamedPosture>().expect_err("no joints");
        "home=start".parse::<NamedPosture>().expect_err("no joints");
    }
}
