//! The triangles of an STL file, binary or text.

use std::path::Path;

use nalgebra::{Point3, Vector3};

use super::error::MeshError;
use super::soup::Soup;

/// The triangles of an STL file, each axis scaled; in the mesh's frame. \[m\]
pub(crate) fn read(path: &Path, scale: &Vector3<f64>) -> Result<Soup, MeshError> {
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
    Ok(Soup::of(vertices.into_iter().map(|v| Point3::from(v.component_mul(scale)))))
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
        let binary = read(file(&bytes).path(), &scale).unwrap();
        assert_eq!(binary.vertices[2], Point3::new(0.0, 4.0, -0.5));
        let ascii = read(file(ascii.as_bytes()).path(), &scale).unwrap();
        assert_eq!((binary.vertices, binary.triangles), (ascii.vertices, ascii.triangles));
        bytes.pop();
        let cut = read(file(&bytes[..]).path(), &scale);
        assert!(matches!(cut, Err(MeshError::Broken { .. })), "{cut:?}");
    }

    #[test]
    fn broken_text_names_the_vertex() {
        let error = read(file(b"solid x vertex 1 2 oops").path(), &Vector3::repeat(1.0));
        assert!(error.unwrap_err().to_string().contains("vertex 0 has `oops`"));
    }
}
