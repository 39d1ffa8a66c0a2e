//! Collision meshes: where a mesh's URI leads, and the vertices of an STL file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};

/// Where meshes named in a URDF are found.
#[derive(Clone, Debug, Default)]
pub struct MeshPaths {
    /// Folder of each ROS package: `package://name/rest` is `packages[name]/rest`.
    pub packages: BTreeMap<String, PathBuf>,
    /// Folder that relative paths start from, usually the URDF's own.
    pub relative_to: PathBuf,
}

/// Why a mesh cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The URI names a package that has no folder.
    #[error("package `{package}` has no folder")]
    UnknownPackage {
        /// The package's name.
        package: String,
    },
    /// Only `package://`, `file://` and plain paths are understood.
    #[error("`{uri}` is neither package://, file:// nor a path")]
    Scheme {
        /// The URI.
        uri: String,
    },
    /// The file cannot be read.
    #[error("{}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// Only STL is read.
    #[error("{}: not an STL file; convert the collision mesh to STL", path.display())]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// The file is cut short or its text is no STL.
    #[error("{}: broken STL: {what}", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// The vertices span no volume.
    #[error("{}: its {vertices} vertices span no volume, so there is no convex hull", path.display())]
    Flat {
        /// The file.
        path: PathBuf,
        /// Number of vertices read.
        vertices: usize,
    },
}

impl MeshPaths {
    /// The file that a mesh URI leads to.
    pub(crate) fn resolve(&self, uri: &str) -> Result<PathBuf, MeshError> {
        if let Some(rest) = uri.strip_prefix("package://") {
            let (package, path) = rest.split_once('/').unwrap_or((rest, ""));
            let folder = self
                .packages
                .get(package)
                .ok_or_else(|| MeshError::UnknownPackage { package: package.into() })?;
            return Ok(folder.join(path));
        }
        if let Some(path) = uri.strip_prefix("file://") {
            return Ok(PathBuf::from(path));
        }
        if uri.contains("://") {
            return Err(MeshError::Scheme { uri: uri.into() });
        }
        Ok(self.relative_to.join(uri))
    }
}

/// The vertices of an STL file, binary or text, each axis scaled; in the mesh's frame. \[m\]
pub(crate) fn read_stl(path: &Path, scale: &Vector3<f64>) -> Result<Vec<Point3<f64>>, MeshError> {
    let bytes =
        std::fs::read(path).map_err(|error| MeshError::Read { path: path.to_path_buf(), error })?;
    let is_stl = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("stl"));
    if !is_stl {
        return Err(MeshError::Format { path: path.to_path_buf() });
    }
    let broken = |what: String| MeshError::Broken { path: path.to_path_buf(), what };
    // Binary files may begin with "solid" too, so the length decides.
    let count = bytes.get(80..84).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let vertices = match count {
        Some(n) if bytes.len() as u64 == 84 + 50 * n as u64 => binary(&bytes[84..]),
        _ if bytes.trim_ascii_start().starts_with(b"solid") => text(&bytes).map_err(&broken)?,
        Some(n) => {
            let (found, wanted) = (bytes.len(), 84 + 50 * n as u64);
            return Err(broken(format!("{found} bytes where {n} triangles take {wanted}")));
        }
        None => return Err(broken(format!("{} bytes are too few", bytes.len()))),
    };
    if let Some(bad) = vertices.iter().position(|v| !v.iter().all(|x| x.is_finite())) {
        return Err(broken(format!("vertex {bad} is not finite")));
    }
    Ok(vertices.into_iter().map(|v| Point3::from(v.component_mul(scale))).collect())
}

fn binary(triangles: &[u8]) -> Vec<Vector3<f64>> {
    let float = |b: &[u8]| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let vertex = |b: &[u8]| Vector3::new(float(&b[0..]), float(&b[4..]), float(&b[8..]));
    // Normal, three vertices, two bytes of attributes.
    triangles
        .chunks_exact(50)
        .flat_map(|t| [vertex(&t[12..]), vertex(&t[24..]), vertex(&t[36..])])
        .collect()
}

fn text(bytes: &[u8]) -> Result<Vec<Vector3<f64>>, String> {
    let mut words = std::str::from_utf8(bytes)
        .map_err(|e| format!("text that is no UTF-8 after byte {}", e.valid_up_to()))?
        .split_ascii_whitespace();
    let mut vertices = Vec::new();
    while let Some(word) = words.next() {
        if word == "vertex" {
            let mut number = || {
                let word = words.next().unwrap_or("the end of the file");
                word.parse::<f64>()
                    .map_err(|_| format!("vertex {} has `{word}` for a number", vertices.len()))
            };
            let vertex = Vector3::new(number()?, number()?, number()?);
            vertices.push(vertex);
        }
    }
    Ok(vertices)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn file(bytes: &[u8]) -> tempfile::NamedTempFile {
        let mut file = tempfile::Builder::new().suffix(".stl").tempfile().unwrap();
        file.write_all(bytes).unwrap();
        file
    }

    #[test]
    fn reads_binary_and_text_alike() {
        let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.5]];
        let mut bytes = b"solid that is binary".to_vec();
        bytes.resize(80, b' ');
        bytes.extend(1u32.to_le_bytes());
        bytes.extend([0u8; 12]);
        bytes.extend(corners.iter().flatten().flat_map(|x| x.to_le_bytes()));
        bytes.extend([0u8; 2]);
        let mut ascii = "solid x\nfacet normal 0 0 1\nouter loop\n".to_string();
        for c in corners {
            ascii += &format!("vertex {} {} {:e}\n", c[0], c[1], c[2]);
        }
        ascii += "endloop\nendfacet\nendsolid x\n";
        let scale = Vector3::new(1.0, 2.0, -1.0);
        let binary = read_stl(file(&bytes).path(), &scale).unwrap();
        assert_eq!(binary[2], Point3::new(0.0, 4.0, -0.5));
        assert_eq!(binary, read_stl(file(ascii.as_bytes()).path(), &scale).unwrap());
        bytes.pop();
        let cut = read_stl(file(&bytes[..]).path(), &scale);
        assert!(matches!(cut, Err(MeshError::Broken { .. })), "{cut:?}");
    }

    #[test]
    fn broken_text_names_the_vertex() {
        let error = read_stl(file(b"solid x vertex 1 2 oops").path(), &Vector3::repeat(1.0));
        assert!(error.unwrap_err().to_string().contains("vertex 0 has `oops`"));
    }

    #[test]
    fn uris_lead_to_files() {
        let paths = MeshPaths {
            packages: [("arm".to_string(), PathBuf::from("share/arm"))].into(),
            relative_to: "urdf".into(),
        };
        assert_eq!(paths.resolve("package://arm/a/b.stl").unwrap(), Path::new("share/arm/a/b.stl"));
        assert_eq!(paths.resolve("file://x/a.stl").unwrap(), Path::new("x/a.stl"));
        assert_eq!(paths.resolve("a.stl").unwrap(), Path::new("urdf/a.stl"));
        let unknown = paths.resolve("package://leg/a.stl").unwrap_err().to_string();
        assert!(unknown.contains("`leg`"), "{unknown}");
        assert!(matches!(paths.resolve("http://x/a.stl"), Err(MeshError::Scheme { .. })));
    }
}
