//! The Python side's structures are those of this crate.

#[path = "../examples/ctypes.rs"]
#[allow(dead_code)] // Its main.
mod ctypes;

#[test]
fn python_has_the_same_structures() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/python/nullsweep_types.py");
    let written = std::fs::read_to_string(path).expect("the Python module is there");
    assert!(
        written == ctypes::module(),
        "the types have changed: cargo run -p nullsweep-ipc-types --example ctypes > \
         examples/python/nullsweep_types.py"
    );
}
