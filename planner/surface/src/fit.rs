//! Local surface fits: the arithmetic shared by cleaning and the surface model.
//!
//! Planes by principal components (Hoppe, DeRose, Duchamp, McDonald & Stuetzle, Surface
//! reconstruction from unorganized points, 1992) and heights over a plane by moving least squares
//! (Alexa, Behr, Cohen-Or, Fleishman, Levin & Silva, Computing and rendering point set surfaces,
//! 2003).

use nalgebra::{Matrix3, Matrix4, Point3, SymmetricEigen, UnitVector3, Vector3, Vector4};

/// Weight of a neighbour by its squared distance as a fraction of the squared radius: (1 − d²/r²)²,
/// Tukey's biweight. Smooth, and zero with zero slope at the radius, so that a fit varies smoothly
/// as its centre moves.
pub(crate) fn weight(squared_fraction: f64) -> f64 {
    let rest = (1.0 - squared_fraction).max(0.0);
    rest * rest
}

/// A weighted plane through points.
#[derive(Clone, Debug)]
pub(crate) struct PlaneFit {
    centre: Point3<f64>,
    weights: f64,
    sum: Vector3<f64>,
    products: Matrix3<f64>,
}

/// The result of a [`PlaneFit`].
pub(crate) struct Plane {
    pub(crate) centroid: Point3<f64>,
    pub(crate) normal: UnitVector3<f64>,
    /// Variances along the normal, the shorter and the longer axis of the points. \[m²\]
    pub(crate) variances: [f64; 3],
}

impl PlaneFit {
    /// An empty fit; `centre` keeps the sums small.
    pub(crate) fn new(centre: Point3<f64>) -> Self {
        Self { centre, weights: 0.0, sum: Vector3::zeros(), products: Matrix3::zeros() }
    }

    pub(crate) fn add(&mut self, point: &Point3<f64>, weight: f64) {
        let d = point - self.centre;
        self.weights += weight;
        self.sum += d * weight;
        self.products += d * d.transpose() * weight;
    }

    /// The plane of least squares; `None` without weight.
    pub(crate) fn solve(&self) -> Option<Plane> {
        if self.weights <= 1e-12 {
            return None;
        }
        let mean = self.sum / self.weights;
        let covariance = self.products / self.weights - mean * mean.transpose();
        let eigen = SymmetricEigen::new(covariance);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        Some(Plane {
            centroid: self.centre + mean,
            normal: UnitVector3::try_new(eigen.eigenvectors.column(order[0]).into_owned(), 1e-9)?,
            variances: order.map(|i| eigen.eigenvalues[i].max(0.0)),
        })
    }
}

/// A weighted fit of the height h = a + b u + c v + d (u² + v²) over a tangent plane.
///
/// The last term takes up the surface's mean curvature; a plane alone would lie inside a curved
/// surface by about half the curvature times the variance of the neighbourhood. A full quadric has
/// two terms more, which few and noisy neighbours do not determine.
#[derive(Clone, Debug)]
pub(crate) struct HeightFit {
    origin: Point3<f64>,
    axes: [Vector3<f64>; 3],
    scale: f64,
    normal_matrix: Matrix4<f64>,
    right: Vector4<f64>,
}

impl HeightFit {
    /// An empty fit of heights along `normal` over a neighbourhood of `radius` about `origin`.
    pub(crate) fn new(origin: Point3<f64>, normal: &UnitVector3<f64>, radius: f64) -> Self {
        let helper = if normal.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
        let u = normal.cross(&helper).normalize();
        Self {
            origin,
            axes: [u, normal.cross(&u), normal.into_inner()],
            scale: 1.0 / radius,
            normal_matrix: Matrix4::zeros(),
            right: Vector4::zeros(),
        }
    }

    pub(crate) fn add(&mut self, point: &Point3<f64>, weight: f64) {
        let d = (point - self.origin) * self.scale;
        let [u, v, h] = self.axes.map(|axis| axis.dot(&d));
        let terms = Vector4::new(1.0, u, v, u * u + v * v);
        let weighted = terms * weight;
        self.normal_matrix += weighted * terms.transpose();
        self.right += weighted * h;
    }

    /// The surface's point on the line through the origin along the normal, and its normal there;
    /// `None` if the points do not determine it.
    pub(crate) fn solve(mut self) -> Option<(Point3<f64>, UnitVector3<f64>)> {
        // A trace of ridge on all but the height keeps points on one line from tilting it.
        let ridge = 1e-4 * self.normal_matrix[(0, 0)];
        for i in 1..4 {
            self.normal_matrix[(i, i)] += ridge;
        }
        let [a, b, c, _] = self.normal_matrix.cholesky()?.solve(&self.right).into();
        let normal = self.axes[2] - self.axes[0] * b - self.axes[1] * c;
        Some((self.origin + self.axes[2] * (a / self.scale), UnitVector3::new_normalize(normal)))
    }
}
