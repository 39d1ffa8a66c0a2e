//! Which executor is meant.

use std::path::Path;
use std::str::FromStr;

use nullsweep_robot::ArmSpec;

/// Where the executor is.
#[derive(Clone, Copy, Debug)]
pub struct Site<'a> {
    /// The robot's name in the services' names.
    pub robot: &'a str,
    /// Root path of iceoryx2, `None` for the default.
    pub root: Option<&'a Path>,
}

/// Under which name the executor of one of several arms is found, as `ARM=NAME` says it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Post {
    /// The arm.
    pub arm: ArmSpec,
    /// The robot's name in the services' names of its executor.
    pub robot: String,
}

impl FromStr for Post {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (arm, robot) = text.rsplit_once('=').ok_or("ARM=NAME is wanted")?;
        Ok(Self { arm: arm.parse()?, robot: robot.into() })
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::Side;

    use super::*;

    #[test]
    fn a_post_is_an_arm_and_a_name() {
        let post: Post = "left=pr2-left".parse().expect("one");
        assert_eq!(post, Post { arm: ArmSpec::pr2(Side::Left), robot: "pr2-left".into() });
        assert_eq!("base,tip=x".parse::<Post>().expect("one").arm.tip, "tip");
        assert!("left".parse::<Post>().is_err() && "middle=x".parse::<Post>().is_err());
    }
}
