//! An error with its causes, in one line.

use std::error::Error;

/// What an error and its causes say, none of it twice: many say their cause themselves.
#[must_use]
pub fn causes(error: &(dyn Error + 'static)) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let own = error.to_string();
        if !text.contains(own.trim_end()) {
            text += ": ";
            text += &own;
        }
        cause = error.source();
    }
    text.replace("stream did not contain valid UTF-8", "it is no text file")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("cannot read it: {source}")]
    struct Outer {
        source: std::io::Error,
    }

    #[derive(Debug, thiserror::Error)]
    #[error("no plan")]
    struct Outermost {
        source: Outer,
    }

    #[test]
    fn no_cause_is_told_twice_and_none_is_lost() {
        let source = std::io::Error::other("the disk is full");
        let error = Outermost { source: Outer { source } };
        assert_eq!(causes(&error), "no plan: cannot read it: the disk is full");
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scan.npy");
        std::fs::write(&path, [0x93, 0xff]).expect("written");
        let source = std::fs::read_to_string(&path).expect_err("no text");
        assert_eq!(causes(&Outer { source }), "cannot read it: it is no text file");
    }
}
