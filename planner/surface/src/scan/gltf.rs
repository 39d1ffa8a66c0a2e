//! glTF and GLB: meshes in a tree of nodes, y up, in metres.

use std::path::Path;

use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::buffer::Source;
use ::gltf::mesh::Mode;
use ::gltf::{Accessor, Gltf, Node, Primitive, Semantic};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use nalgebra::{Matrix4, Point3};

use super::error::{Malformed, Place, malformed};
use super::guarded::guarded;
use super::parsed::Parsed;
use super::warning::ScanWarning;

/// A GLB file's head: magic, version, length.
const HEAD: usize = 12;

/// Reads the triangles and points of the default scene, or of the first; buffers in files of their
/// own lie beside `path`.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Parsed, Malformed> {
    guarded(|| read(bytes, path))
}

fn read(bytes: &[u8], path: &Path) -> Result<Parsed, Malformed> {
    let wrong = |error: ::gltf::Error| Malformed { place: Place::File, cause: error.to_string() };
    let announced = bytes.get(8..HEAD).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    if bytes.starts_with(b"glTF") && announced.is_none_or(|n| (n as usize) < HEAD) {
        return malformed(Place::Byte(8), "the head is cut short");
    }
    let file = Gltf::from_slice(bytes).map_err(wrong)?;
    let mut buffers = Vec::new();
    for buffer in file.buffers() {
        buffers.push(match buffer.source() {
            Source::Bin => file.blob.clone().unwrap_or_default(),
            Source::Uri(uri) => outside(uri, path)?,
        });
    }
    let Some(scene) = file.default_scene().or_else(|| file.scenes().next()) else {
        return malformed(Place::File, "there is no scene in it");
    };
    let mut gathered = Gathered { buffers, parsed: Parsed::default() };
    let mut seen = vec![false; file.nodes().count()];
    let mut open: Vec<(Node<'_>, Matrix4<f64>)> =
        scene.nodes().map(|node| (node, Matrix4::identity())).collect();
    while let Some((node, parent)) = open.pop() {
        // Nodes form trees; what leads back is left out, so that the way ends.
        if std::mem::replace(&mut seen[node.index()], true) {
            continue;
        }
        let columns = node.transform().matrix();
        let pose = parent * Matrix4::from_fn(|row, column| f64::from(columns[column][row]));
        for primitive in node.mesh().iter().flat_map(|mesh| mesh.primitives()) {
            gathered.add(&primitive, &pose)?;
        }
        open.extend(node.children().map(|child| (child, pose)));
    }
    let mut parsed = gathered.parsed;
    parsed.warnings.push(ScanWarning::Upright { format: "glTF", up: [0.0, 1.0, 0.0] });
    Ok(parsed)
}

/// A buffer that is written into its address, or in a file of its own.
fn outside(uri: &str, path: &Path) -> Result<Vec<u8>, Malformed> {
    if let Some((_, data)) = uri.strip_prefix("data:").and_then(|data| data.split_once(";base64,"))
    {
        return STANDARD.decode(data).map_err(|error| Malformed {
            place: Place::File,
            cause: format!("a buffer: {error}"),
        });
    }
    let file = path.parent().unwrap_or(Path::new("")).join(uri);
    std::fs::read(&file).map_err(|error| Malformed {
        place: Place::File,
        cause: format!("its buffer {}: {error}", file.display()),
    })
}

/// What was read so far.
struct Gathered {
    buffers: Vec<Vec<u8>>,
    parsed: Parsed,
}

impl Gathered {
    fn add(&mut self, primitive: &Primitive<'_>, pose: &Matrix4<f64>) -> Result<(), Malformed> {
        let Some(positions) = primitive.get(&Semantic::Positions) else { return Ok(()) };
        if (positions.data_type(), positions.dimensions()) != (DataType::F32, Dimensions::Vec3) {
            return malformed(Place::File, "positions are no vectors of three floats");
        }
        let from = self.parsed.points.len();
        let mut points = Vec::new();
        for at in self.values(&positions, 12)? {
            let number =
                |i: usize| f64::from(f32::from_le_bytes([at[i], at[i + 1], at[i + 2], at[i + 3]]));
            let p = pose * Point3::new(number(0), number(4), number(8)).to_homogeneous();
            points.push(Point3::new(p.x, p.y, p.z));
        }
        let count = points.len();
        self.parsed.points.append(&mut points);
        let corners: Vec<usize> = match primitive.indices() {
            None => (0..count).collect(),
            Some(indices) => self.indices(&indices)?,
        };
        if let Some(index) = corners.iter().find(|&&index| index >= count) {
            return malformed(Place::File, format!("index {index} names none of {count} vertices"));
        }
        let corner = |i: usize| from + corners[i];
        let triangle = |i: usize, j: usize, k: usize| [corner(i), corner(j), corner(k)];
        let last = corners.len();
        match primitive.mode() {
            Mode::Triangles => {
                let all = (2..last).step_by(3).map(|k| triangle(k - 2, k - 1, k));
                self.parsed.triangles.extend(all);
            }
            Mode::TriangleStrip => {
                let turned =
                    |k: usize| if k.is_multiple_of(2) { (k - 2, k - 1) } else { (k - 1, k - 2) };
                let all = (2..last).map(|k| triangle(turned(k).0, turned(k).1, k));
                self.parsed.triangles.extend(all);
            }
            Mode::TriangleFan => {
                self.parsed.triangles.extend((2..last).map(|k| triangle(0, k - 1, k)));
            }
            // Points; lines are no surface, but their ends are points too.
            _ => {}
        }
        Ok(())
    }

    /// The bytes of each value of an accessor.
    fn values(&self, accessor: &Accessor<'_>, size: usize) -> Result<Vec<&[u8]>, Malformed> {
        let Some(view) = accessor.view().filter(|_| accessor.sparse().is_none()) else {
            return malformed(Place::File, "sparse accessors are not read: export without them");
        };
        let stride = view.stride().unwrap_or(size).max(1);
        let buffer = self.buffers.get(view.buffer().index()).map_or(&[][..], |buffer| buffer);
        let begin = view.offset().checked_add(accessor.offset());
        let end = view.offset().checked_add(view.length());
        let part = begin.zip(end).and_then(|(begin, end)| buffer.get(begin..end));
        let needed = (accessor.count().saturating_sub(1)).checked_mul(stride);
        let needed = needed.and_then(|bytes| bytes.checked_add(size));
        match (part, needed) {
            (Some(part), Some(needed)) if needed <= part.len() => {
                Ok((0..accessor.count()).map(|i| &part[i * stride..i * stride + size]).collect())
            }
            _ => malformed(
                Place::File,
                format!("{} values do not fit into their buffer", accessor.count()),
            ),
        }
    }

    fn indices(&self, accessor: &Accessor<'_>) -> Result<Vec<usize>, Malformed> {
        let size = match accessor.data_type() {
            DataType::U8 => 1,
            DataType::U16 => 2,
            DataType::U32 => 4,
            _ => return malformed(Place::File, "indices are no whole numbers"),
        };
        let whole = |bytes: &[u8]| {
            bytes.iter().rev().fold(0usize, |index, byte| index << 8 | usize::from(*byte))
        };
        Ok(self.values(accessor, size)?.into_iter().map(whole).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of two triangles in the plane y = 1, moved by the node to x from 2 on.
    fn square() -> (String, Vec<u8>) {
        let corners = [[0.0f32, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]];
        let mut data: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        data.extend([0u16, 2, 1, 0, 3, 2].iter().flat_map(|i| i.to_le_bytes()));
        let json = "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\
             \"nodes\":[{\"translation\":[2,0,0],\"children\":[1]},{\"mesh\":0}],\
             \"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1}]}],\
             \"buffers\":[{BUFFER\"byteLength\":60}],\
             \"bufferViews\":[{\"buffer\":0,\"byteLength\":48},\
             {\"buffer\":0,\"byteOffset\":48,\"byteLength\":12}],\
             \"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\
             \"min\":[0,1,0],\"max\":[1,1,1]},\
             {\"bufferView\":1,\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\"}]}";
        (json.into(), data)
    }

    fn glb() -> Vec<u8> {
        let (json, data) = square();
        let mut json = json.replace("BUFFER", "");
        while json.len() % 4 != 0 {
            json.push(' ');
        }
        let mut bytes = b"glTF".to_vec();
        bytes.extend(2u32.to_le_bytes());
        bytes.extend((12 + 8 + json.len() as u32 + 8 + data.len() as u32).to_le_bytes());
        bytes.extend((json.len() as u32).to_le_bytes());
        bytes.extend(b"JSON");
        bytes.extend(json.as_bytes());
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(b"BIN\0");
        bytes.extend(data);
        bytes
    }

    #[test]
    fn meshes_stand_where_their_nodes_say_and_up_is_told() {
        let (json, data) = square();
        let uri =
            format!("\"uri\":\"data:application/gltf-buffer;base64,{}\",", STANDARD.encode(data));
        let path = Path::new("x.gltf");
        for bytes in [glb(), json.replace("BUFFER", &uri).into_bytes()] {
            let parsed = parse(&bytes, path).unwrap();
            assert_eq!(parsed.points[2], Point3::new(3.0, 1.0, 1.0));
            assert_eq!(parsed.triangles, [[0, 2, 1], [0, 3, 2]]);
            let up = ScanWarning::Upright { format: "glTF", up: [0.0, 1.0, 0.0] };
            assert_eq!(parsed.warnings, [up]);
        }
    }

    #[test]
    fn broken_files_are_refused_without_a_panic() {
        let (json, _) = square();
        let missing = json.replace("BUFFER", "\"uri\":\"no/such.bin\",");
        let cause = parse(missing.as_bytes(), Path::new("x.gltf")).unwrap_err().cause;
        assert!(cause.contains("such.bin"), "{cause}");
        let whole = glb();
        for cut in 0..whole.len() {
            assert!(parse(&whole[..cut], Path::new("x.glb")).is_err(), "{cut}");
        }
        for at in 0..whole.len() {
            for value in [0x00, b'9', 0xFF] {
                let mut bytes = whole.clone();
                bytes[at] = value;
                let _ = parse(&bytes, Path::new("x.glb"));
            }
        }
        // Nodes that lead back to themselves.
        let circle = json.replace("{\"mesh\":0}", "{\"mesh\":0,\"children\":[0]}");
        let _ = parse(circle.replace("BUFFER", "").as_bytes(), Path::new("x.gltf"));
    }
}
