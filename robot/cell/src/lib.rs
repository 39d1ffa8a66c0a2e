//! What the command lines of the programs share: the cell file, which says once which robot, tool and
//! scene are meant, and how a program tells another one what it can be asked for.
//!
//! It knows no robot and no planner: a cell is names of files and numbers, which become defaults of
//! whatever flags a program has. What is given on the command line wins.

mod causes;
mod defaults;
mod describe;
mod file;
mod front;
mod parse;

pub use causes::causes;
pub use defaults::{Defaults, FLAGS};
pub use describe::{DESCRIBE, Described};
pub use file::{Cell, CellError, FILE_NAME};
pub use front::{FRONT, PROGRAMS, as_called, beside, is_program, named_in};
pub use parse::{VARIABLE, parse, parse_alone, take};
