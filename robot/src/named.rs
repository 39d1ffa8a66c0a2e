//! Arms as programs name them on their command lines.

use std::fmt;
use std::str::FromStr;

use crate::pr2::Side;
use crate::spec::ArmSpec;

/// As programs take it: `right` or `left` for the PR2's, else BASE,TIP, two links. A colon may stand
/// for the comma.
impl FromStr for ArmSpec {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "right" => Ok(Self::pr2(Side::Right)),
            "left" => Ok(Self::pr2(Side::Left)),
            links => match links.split_once([',', ':']) {
                Some((base, tip)) if !base.is_empty() && !tip.is_empty() => {
                    Ok(Self { base: base.trim().into(), tip: tip.trim().into() })
                }
                _ => Err("right, left or BASE,TIP (two links) is wanted".into()),
            },
        }
    }
}

impl fmt::Display for ArmSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}", self.base, self.tip)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arms_are_named_alike_everywhere() {
        let spec = |text: &str| text.parse::<ArmSpec>();
        assert_eq!(spec("left"), Ok(ArmSpec::pr2(Side::Left)));
        assert_eq!(spec("right"), Ok(ArmSpec::pr2(Side::Right)));
        let links = Ok(ArmSpec { base: "base_link".into(), tip: "tool_tip".into() });
        assert_eq!(spec("base_link,tool_tip"), links);
        assert_eq!(spec("base_link:tool_tip"), links);
        for wrong in ["", "middle", "base_link,", ",tip"] {
            spec(wrong).expect_err(wrong);
        }
    }
}
