//! What is known of the motions between two layers.

/// Jumps made between two layers after which the others are put off: they are expensive, and their cost
/// hardly depends on the sample.
const MAX_JUMPS: usize = 3;
/// Failed jumps between two layers, no two of them alike, after which one of the layers is left out.
const MAX_FAILED_JUMPS: usize = 12;
/// How much longer a doubtful motion is taken to be, before one was made.
const DOUBT: f32 = 1.2;
/// So many doubtful motions between two layers may fail, and as many again for each that was made,
/// until the others are given up.
const MAX_FAILED_DOUBTFUL: usize = 8;

/// How two samples are joined, and what is known of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// To be tracked along the surface; an estimate.
    Track,
    /// To be tracked in whatever way goes, as the even change is likely to be blocked; an estimate.
    Doubtful,
    /// To be jumped; an estimate.
    Jump,
    /// A jump that is not tried, as enough others were made.
    Spare,
    /// The motion was made, or cannot be made: the cost is true.
    Known,
}

/// What is known of the edges between two layers' samples: matrices, row-major from × to.
pub(super) struct Edges {
    pub(super) width: usize,
    /// The true cost where it is known, else the estimate.
    pub(super) estimate: Vec<f32>,
    /// The cost of the straight joint line.
    straight: Vec<f32>,
    kind: Vec<Kind>,
    /// What a jump costs besides its motion.
    lift: f32,
    /// Ratios of true to straight cost seen here, of tracks, of doubtful ones and of jumps: their
    /// sum and number.
    ratios: [(f32, f32); 3],
    /// Doubtful motions that were made, and that failed.
    doubtful: [usize; 2],
    /// Jumps that were made, and that failed though the tool can be lifted off at both ends.
    jumps: usize,
    failed_jumps: usize,
}

impl Edges {
    /// Without any, with room for so many.
    pub(super) fn new(width: usize, size: usize, lift: f32) -> Self {
        Self {
            width,
            estimate: Vec::with_capacity(size),
            straight: Vec::with_capacity(size),
            kind: Vec::with_capacity(size),
            lift,
            ratios: [(0.0, 0.0); 3],
            doubtful: [0; 2],
            jumps: 0,
            failed_jumps: 0,
        }
    }

    /// Appends the next one, row by row.
    pub(super) fn push(&mut self, kind: Kind, straight: f32) {
        self.straight.push(straight);
        self.kind.push(kind);
        self.estimate.push(self.guess(kind, straight));
    }

    pub(super) fn kind(&self, a: usize, b: usize) -> Kind {
        self.kind[a * self.width + b]
    }

    fn guess(&self, kind: Kind, straight: f32) -> f32 {
        let ratio = |kind: Kind, unseen: f32| match self.ratios[kind as usize] {
            (_, 0.0) => unseen,
            (sum, seen) => sum / seen,
        };
        match kind {
            Kind::Track => straight * ratio(kind, 1.0),
            Kind::Doubtful => straight * ratio(kind, DOUBT * ratio(Kind::Track, 1.0)),
            Kind::Jump => self.lift + straight * ratio(kind, 1.0),
            Kind::Spare | Kind::Known => f32::INFINITY,
        }
    }

    /// Puts a true cost in place and estimates the others anew.
    pub(super) fn learn(&mut self, a: usize, b: usize, cost: f64) {
        let at = a * self.width + b;
        let kind = self.kind[at];
        let motion = cost as f32 - if kind == Kind::Jump { self.lift } else { 0.0 };
        let (sum, seen) = &mut self.ratios[kind as usize];
        *sum += motion / self.straight[at].max(1e-6);
        *seen += 1.0;
        self.doubtful[0] += usize::from(kind == Kind::Doubtful);
        self.jumps += usize::from(kind == Kind::Jump);
        self.kind[at] = Kind::Known;
        self.estimate[at] = cost as f32;
        if self.jumps >= MAX_JUMPS {
            self.turn(Kind::Jump, Kind::Spare);
        }
        for i in 0..self.kind.len() {
            if self.kind[i] != Kind::Known {
                self.estimate[i] = self.guess(self.kind[i], self.straight[i]);
            }
        }
    }

    fn set(&mut self, at: usize, kind: Kind) {
        self.kind[at] = kind;
        self.estimate[at] = self.guess(kind, self.straight[at]);
    }

    pub(super) fn doubt(&mut self, a: usize, b: usize) {
        let at = a * self.width + b;
        if self.kind[at] == Kind::Track {
            self.set(at, Kind::Doubtful);
        }
    }

    /// After a doubtful motion that failed; after too many, all of them.
    pub(super) fn fall_back_to_jump(&mut self, a: usize, b: usize) {
        self.set(a * self.width + b, Kind::Jump);
        let [made, failed] = &mut self.doubtful;
        *failed += 1;
        if *failed >= MAX_FAILED_DOUBTFUL * (*made + 1) {
            self.turn(Kind::Doubtful, Kind::Jump);
        }
    }

    pub(super) fn close(&mut self, a: usize, b: usize) {
        self.set(a * self.width + b, Kind::Known);
    }

    /// Gives up the jumps between the samples (row, column) that `which` picks, but those made.
    pub(super) fn close_jumps(&mut self, which: impl Fn(usize, usize) -> bool) {
        for at in 0..self.kind.len() {
            let is_jump = matches!(self.kind[at], Kind::Jump | Kind::Spare);
            if is_jump && which(at / self.width, at % self.width) {
                self.set(at, Kind::Known);
            }
        }
    }

    /// Offers the jumps again that were put off; whether there were any.
    pub(super) fn reopen(&mut self) -> bool {
        self.jumps = 0;
        self.turn(Kind::Spare, Kind::Jump)
    }

    fn turn(&mut self, from: Kind, to: Kind) -> bool {
        let mut any = false;
        for at in 0..self.kind.len() {
            if self.kind[at] == from {
                self.set(at, to);
                any = true;
            }
        }
        any
    }

    /// Counts a failed jump if it was `fair`, the tool lifted off at both ends; whether the layer is
    /// to be given up.
    pub(super) fn strike(&mut self, fair: bool) -> bool {
        self.failed_jumps += usize::from(fair);
        self.failed_jumps > MAX_FAILED_JUMPS || self.is_closed()
    }

    /// Whether no edge is left.
    fn is_closed(&self) -> bool {
        self.estimate.iter().all(|e| e.is_infinite())
    }
}
