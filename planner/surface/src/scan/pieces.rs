//! The connected pieces of a mesh, each wound one way.

/// Faces that hang together by edges.
pub(super) struct Piece {
    /// Index of each face, and whether it is to be turned so that all are wound as the first.
    pub(super) faces: Vec<(usize, bool)>,
    /// No edge is a border.
    pub(super) closed: bool,
    /// One winding fits all; not so on a Möbius strip.
    pub(super) oriented: bool,
}

impl Piece {
    /// Whether the file has faces wound against others.
    pub(super) fn mixed(&self) -> bool {
        self.faces.iter().any(|f| f.1) && !self.faces.iter().all(|f| f.1)
    }
}

/// The two faces at an edge, and whether they go along it the same way, that is are wound against
/// each other.
type Joint = (usize, bool);

/// Cuts a mesh into pieces. Faces hang together where just two share an edge; where more meet,
/// nobody knows which go on into which.
pub(super) fn pieces(triangles: &[[usize; 3]]) -> Vec<Piece> {
    let mut edges: Vec<([usize; 2], usize, bool)> = Vec::with_capacity(3 * triangles.len());
    for (face, corners) in triangles.iter().enumerate() {
        for side in 0..3 {
            let (a, b) = (corners[side], corners[(side + 1) % 3]);
            edges.push(([a.min(b), a.max(b)], face, a < b));
        }
    }
    edges.sort_unstable();
    let mut joints: Vec<[Option<Joint>; 3]> = vec![[None; 3]; triangles.len()];
    let mut join = |face: usize, joint: Joint| {
        if let Some(free) = joints[face].iter_mut().find(|slot| slot.is_none()) {
            *free = Some(joint);
        }
    };
    for shared in edges.chunk_by(|a, b| a.0 == b.0) {
        if let [(_, a, way_a), (_, b, way_b)] = shared {
            join(*a, (*b, way_a == way_b));
            join(*b, (*a, way_a == way_b));
        }
    }
    let mut turned: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut pieces = Vec::new();
    for start in 0..triangles.len() {
        if turned[start].is_some() {
            continue;
        }
        turned[start] = Some(false);
        let mut piece = Piece { faces: vec![(start, false)], closed: true, oriented: true };
        let mut next = 0;
        while let Some(&(face, here)) = piece.faces.get(next) {
            next += 1;
            piece.closed &= joints[face].iter().all(Option::is_some);
            for &(other, against) in joints[face].iter().flatten() {
                let wanted = here != against;
                match turned[other] {
                    None => {
                        turned[other] = Some(wanted);
                        piece.faces.push((other, wanted));
                    }
                    Some(there) => piece.oriented &= there == wanted,
                }
            }
        }
        pieces.push(piece);
    }
    pieces
}
