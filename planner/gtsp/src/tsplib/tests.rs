//! Every weight type and format, malformed files by line, and instances written and read again.

use proptest::prelude::*;

use super::*;
use crate::tests::{KINDS, random_instance};
use crate::{
    Budget, Costs, Ends, Instance, Jump, solve, solve_exact, solve_transformed, transform,
};

fn file(header: &str, data: &str) -> String {
    format!(
        "NAME : t\nTYPE : GTSP\nDIMENSION : 3\nGTSP_SETS : 2\n{header}\n{data}\nGTSP_SET_SECTION\n1 1 3 -1\n2 2 -1\nEOF\n"
    )
}

/// Cost of the arc from file node 1 to file node 2 and back.
fn arcs(text: &str) -> (f64, f64) {
    let file = parse_gtsp(text.as_bytes()).expect("well formed");
    let arc = |a, b| file.instance.arc(a, 0, b, 0).expect("finite");
    (arc(0, 1), arc(1, 0))
}

#[test]
fn every_weight_type_gives_its_distance() {
    let check = |kind: &str, points: [&str; 3], expected: f64| {
        let rows: String =
            points.iter().enumerate().map(|(k, p)| format!("{} {p}\n", k + 1)).collect();
        let text =
            file(&format!("EDGE_WEIGHT_TYPE : {kind}"), &format!("NODE_COORD_SECTION\n{rows}"));
        assert_eq!(arcs(&text), (expected, expected), "{kind}");
    };
    let flat = ["0 0", "3 1", "9 9"];
    check("EUC_2D", flat, 3.0);
    check("CEIL_2D", flat, 4.0);
    check("FLOOR_2D", flat, 3.0);
    check("MAN_2D", flat, 4.0);
    check("MAX_2D", flat, 3.0);
    check("ATT", flat, 1.0);
    let space = ["0 0 0", "1 2 4", "9 9 9"];
    check("EUC_3D", space, 5.0);
    check("MAN_3D", space, 7.0);
    check("MAX_3D", space, 4.0);
    // ulysses16: the distance of its first two nodes is 509 km.
    check("GEO", ["38.24 20.42", "39.57 26.15", "40.56 25.32"], 509.0);
    // att48: the distance of its first two nodes is 1495.
    check("ATT", ["6734 1453", "2233 10", "5530 1424"], 1495.0);
}

#[test]
fn every_matrix_format_is_read() {
    let check = |format: &str, numbers: &str, expected: (f64, f64)| {
        let header = format!("EDGE_WEIGHT_TYPE : EXPLICIT\nEDGE_WEIGHT_FORMAT : {format}");
        assert_eq!(
            arcs(&file(&header, &format!("EDGE_WEIGHT_SECTION\n{numbers}"))),
            expected,
            "{format}"
        );
    };
    // d12 = 5, d13 = 6, d23 = 7.
    check("FULL_MATRIX", "0 5 6\n4 0 7\n6 7 0", (5.0, 4.0));
    for (format, numbers) in [
        ("UPPER_ROW", "5 6 7"),
        ("LOWER_ROW", "5 6 7"),
        ("UPPER_DIAG_ROW", "0 5 6 0 7 0"),
        ("LOWER_DIAG_ROW", "0 5 0 6 7 0"),
        ("UPPER_COL", "5 6 7"),
        ("LOWER_COL", "5 6 7"),
        ("UPPER_DIAG_COL", "0 5 0 6 7 0"),
        ("LOWER_DIAG_COL", "0 5 6 0 7 0"),
    ] {
        check(format, numbers, (5.0, 5.0));
    }
    check("FULL_MATRIX", "0 0.5 6\n1e-3 0 7\n6 7 0", (0.5, 0.001));
}

#[test]
fn malformed_files_name_the_line() {
    let header = "EDGE_WEIGHT_TYPE : EUC_2D";
    let points = "NODE_COORD_SECTION\n1 0 0\n2 1 1\n3 2 2";
    let good = file(header, points);
    assert!(parse_gtsp(good.as_bytes()).is_ok());
    let check = |from: &str, to: &str, expected: TsplibError| {
        let text = good.replace(from, to);
        assert_ne!(text, good);
        let error = parse_gtsp(text.as_bytes()).expect_err(to);
        assert_eq!(error, expected);
        assert!(error.to_string().contains("line "), "{error}");
    };
    let word = |s: &str| s.to_owned();
    check("2 1 1", "2 1 x", TsplibError::Number { line: 8, found: word("x") });
    check("2 1 1", "2 nan 1", TsplibError::Number { line: 8, found: word("nan") });
    check("2 1 1", "7 1 1", TsplibError::NodeNumber { line: 8, number: 7, nodes: 3 });
    check("2 1 1", "1 1 1", TsplibError::Twice { line: 8, node: 1 });
    check("1 1 3 -1", "1 1 2 3 -1", TsplibError::Twice { line: 12, node: 2 });
    check("1 1 3 -1", "1 1 -1", TsplibError::NoSet { line: 12, node: 3 });
    check("1 1 3 -1", "5 1 3 -1", TsplibError::SetNumber { line: 11, set: 5, sets: 2 });
    check("2 2 -1", "1 2 -1", TsplibError::SetTwice { line: 12, set: 1 });
    check(
        "2 2 -1\n",
        "2 2",
        TsplibError::Count { line: 12, what: "a node number", found: word("2EOF") },
    );
    check("2 2 -1\nEOF", "2", TsplibError::Short { line: 13, what: "GTSP_SET_SECTION" });
    check(
        "EUC_2D",
        "XRAY1",
        TsplibError::UnknownValue { line: 5, key: word("EDGE_WEIGHT_TYPE"), value: word("XRAY1") },
    );
    check("NAME", "NAMES", TsplibError::UnknownKey { line: 1, key: word("NAMES") });
    check(
        "DIMENSION : 3\n",
        "",
        TsplibError::Missing { line: 5, what: "DIMENSION before the data" },
    );
    check(
        "DIMENSION : 3",
        "DIMENSION : -3",
        TsplibError::Count { line: 3, what: "DIMENSION", found: word("-3") },
    );
    check(
        "DIMENSION : 3",
        "DIMENSION : 99999999999",
        TsplibError::Short { line: 6, what: "NODE_COORD_SECTION" },
    );
    check(
        "TYPE : GTSP",
        "TYPE : CVRP",
        TsplibError::UnknownValue { line: 2, key: word("TYPE"), value: word("CVRP") },
    );
}

#[test]
fn odd_headers_are_read() {
    let header = "EDGE_WEIGHT_TYPE : EUC_2D";
    let text = file(header, "NODE_COORD_SECTION\n1 0 0\n2 1 1\n3 2 2")
        .replace("TYPE : GTSP\n", "TYPE  AGTSP (somebody)\nCOMMENT : x : y\n")
        .replace("GTSP_SETS :", "GTSP_SETS:")
        .replace('\n', "\r\n");
    let file = parse_gtsp(text.as_bytes()).expect("well formed");
    assert_eq!(file.node_numbers, [vec![1, 3], vec![2]]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 30, ..ProptestConfig::default() })]

    #[test]
    fn exported_instances_keep_their_optima(
        kind in 0..KINDS.len() - 1, clusters in 2..7_usize, ends in 0..3_usize, seed: u64,
    ) {
        let instance = random_instance(KINDS[kind], clusters, 3, ends, seed);
        let mut text = Vec::new();
        let exported = export(&instance, "x", &mut text).expect("memory");
        let file = parse_gtsp(&text).expect("well formed");
        let solution = solve(&file.instance, &Budget::trials(100), 1).expect("limited");
        let mut tour_file = Vec::new();
        let numbers = file.tour_numbers(&solution.tour);
        write_tour("x", &numbers, solution.cost.total(), &mut tour_file).expect("memory");
        prop_assert_eq!(file.parse_tour(&tour_file).expect("well formed"), solution.tour);
        let tour = exported.tour(&instance, &numbers).expect("all numbers exist");
        tour.check(&instance).expect("valid");
        let (_, optimum) = solve_exact(&instance).expect("small");
        let rounding = clusters as f64 / exported.scale;
        prop_assert!((tour.cost(&instance).total() - optimum.total()).abs() <= rounding + 1e-9);
    }

    #[test]
    fn the_transformation_keeps_small_optima(clusters in 2..5_usize, ends in 0..3_usize, seed: u64) {
        let instance = random_instance(KINDS[1], clusters, 3, ends, seed);
        let (_, optimum) = solve_exact(&instance).expect("small");
        let transformed = transform(&instance);
        // Exact optimum of the ATSP: every node is a cluster.
        let n = transformed.nodes;
        let costs = Costs::Dense(transformed.matrix.iter().map(|&w| w as f64).collect());
        let atsp = Instance::new(&vec![1; n], costs, Jump::Forbidden, Ends::Closed)
            .expect("fits");
        if let Some((tour, cost)) = solve_exact(&atsp) {
            let expected = optimum.total() * transformed.scale
                + (transformed.penalty * transformed.clusters as i64) as f64;
            prop_assert!((cost.total() - expected).abs() <= transformed.clusters as f64);
            let back = transformed.tour(&instance, &tour.clusters).expect("all nodes");
            let slack = transformed.clusters as f64 / transformed.scale;
            prop_assert!((back.cost(&instance).total() - optimum.total()).abs() <= slack);
        }
        let (tour, cost) = solve_transformed(&instance, 50, 1, &|| false);
        tour.check(&instance).expect("valid");
        prop_assert!(cost.total() >= optimum.total() - 1e-9);
    }

    #[test]
    fn any_bytes_end_in_an_answer(text in "[A-Z_:0-9 .\\-\n]{0,300}") {
        let _ = parse_gtsp(text.as_bytes());
    }
}
