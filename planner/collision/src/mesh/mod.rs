//! Collision meshes: where a mesh's URI leads, and the convex pieces that stand for the mesh.

mod error;
mod hull;
mod packages;
mod pieces;
mod soup;
mod stl;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Vector3;

pub use error::MeshError;
pub(crate) use hull::Hull;
use packages::Packages;

/// Where meshes named in a URDF are found, and those that were read already: clones share them.
#[derive(Clone, Debug, Default)]
pub struct MeshPaths {
    packages: Packages,
    relative_to: PathBuf,
    read: Arc<Mutex<HashMap<Key, Arc<[Hull]>>>>,
}

/// A mesh's file and the bits of its scale.
type Key = (PathBuf, [u64; 3]);

/// Where a mesh is.
pub(crate) struct Found {
    path: PathBuf,
    /// Package, its folder, and the kind of place, where the package had to be looked for.
    pub(crate) told: Option<String>,
}

impl MeshPaths {
    /// Of a URDF in a folder, which relative paths start from. `packages` names folders of ROS
    /// packages, so that `package://name/rest` is `packages[name]/rest`; others are looked for
    /// beside the URDF, where AMENT_PREFIX_PATH and ROS_PACKAGE_PATH lead, and in the installed
    /// packages of Python.
    #[must_use]
    pub fn of_machine(urdf_folder: &Path, packages: BTreeMap<String, PathBuf>) -> Self {
        let relative_to = urdf_folder.to_path_buf();
        let packages = Packages::of_machine(urdf_folder, packages);
        Self { packages, relative_to, ..Self::default() }
    }

    /// Only these packages, and nothing of the machine's.
    #[must_use]
    pub fn of_packages(packages: BTreeMap<String, PathBuf>) -> Self {
        Self { packages: Packages::given(packages), ..Self::default() }
    }

    /// The file that a mesh URI leads to.
    pub(crate) fn resolve(&self, uri: &str) -> Result<Found, MeshError> {
        let plain = |path| Found { path, told: None };
        if let Some(rest) = uri.strip_prefix("package://") {
            let (package, file) = rest.split_once('/').unwrap_or((rest, ""));
            let Some((folder, place)) = self.packages.find(package, file) else {
                let looked = self.packages.looked();
                let (package, file) = (package.into(), file.into());
                return Err(MeshError::UnknownPackage { package, file, looked });
            };
            let told = place.map(|_| format!("package {package} is {}", folder.display()));
            return Ok(Found { path: folder.join(file), told });
        }
        if let Some(path) = uri.strip_prefix("file://") {
            return Ok(plain(PathBuf::from(path)));
        }
        if uri.contains("://") {
            return Err(MeshError::Scheme { uri: uri.into() });
        }
        Ok(plain(self.relative_to.join(uri)))
    }

    /// Convex hulls that together hold the mesh, each axis scaled; in the mesh's frame.
    pub(crate) fn hulls(
        &self,
        found: &Found,
        scale: &Vector3<f64>,
    ) -> Result<Arc<[Hull]>, MeshError> {
        let key = (found.path.clone(), [0, 1, 2].map(|i| scale[i].to_bits()));
        // Held while a mesh is read, so that it is read once.
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(hulls) = read.get(&key) {
            return Ok(Arc::clone(hulls));
        }
        let soup = stl::read(&found.path, scale)?;
        let vertices = soup.vertices.len();
        let flat = || MeshError::Flat { path: found.path.clone(), vertices };
        let whole = Hull::new(&soup.vertices).ok_or_else(flat)?;
        let parts: Option<Arc<[Hull]>> =
            pieces::pieces(soup).iter().map(|points| Hull::about(points)).collect();
        let hulls = parts.unwrap_or_else(|| Arc::from([whole]));
        read.insert(key, Arc::clone(&hulls));
        Ok(hulls)
    }
}
