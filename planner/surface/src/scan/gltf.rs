//! glTF and GLB: meshes in a tree of nodes, y up, in metres.

use std::io::Read as _;
use std::path::{Component, Path};

use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::buffer::Source;
use ::gltf::mesh::Mode;
use ::gltf::{Accessor, Gltf, Node, Primitive, Semantic};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use nalgebra::{Matrix4, Point3};
use percent_encoding::percent_decode_str;

use super::error::{Malformed, Place, malformed};
use super::guarded::guarded;
use super::parsed::Parsed;
use super::warning::ScanWarning;

/// A GLB file's head: magic, version, length.
const HEAD: usize = 12;
/// Bytes of a position.
const POSITION: usize = 12;
/// Bytes that nodes may use more than once, all in all: a mesh may be in many places.
const SHARED: usize = 64 << 20;

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
        let mut bytes = match buffer.source() {
            Source::Bin => file.blob.clone().unwrap_or_default(),
            Source::Uri(uri) => outside(uri, path, buffer.length())?,
        };
        if bytes.len() < buffer.length() {
            let (found, told) = (bytes.len(), buffer.length());
            let cause = format!("a buffer of {told} bytes is announced, {found} are there");
            return malformed(Place::File, cause);
        }
        bytes.truncate(buffer.length());
        buffers.push(bytes);
    }
    let Some(scene) = file.default_scene().or_else(|| file.scenes().next()) else {
        return malformed(Place::File, "there is no scene in it");
    };
    let parsed = Parsed { sensor: None, ..Parsed::default() };
    let held = buffers.iter().map(Vec::len).sum();
    let mut gathered = Gathered { buffers, held, taken: 0, parsed };
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

/// A buffer that is written into its address, or in a file of its own: one beside `path` or in a
/// folder there, of which no more is read than is announced.
fn outside(uri: &str, path: &Path, length: usize) -> Result<Vec<u8>, Malformed> {
    if let Some((_, data)) = uri.strip_prefix("data:").and_then(|data| data.split_once(";base64,"))
    {
        return STANDARD.decode(data).map_err(|error| Malformed {
            place: Place::File,
            cause: format!("a buffer: {error}"),
        });
    }
    let wrong = |cause: String| Malformed { place: Place::File, cause };
    let name = percent_decode_str(uri).decode_utf8();
    let name = name.map_err(|error| wrong(format!("its buffer {uri:.80}: {error}")))?;
    let is_below = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
    if name.contains("://") || !Path::new(&*name).components().all(is_below) {
        return Err(wrong(format!("its buffer {name:.80} is no file beside it or below")));
    }
    let file = path.parent().unwrap_or(Path::new("")).join(&*name);
    let read = || {
        // Nothing else is opened: a pipe would wait for ever.
        if !std::fs::metadata(&file)?.is_file() {
            return Err(std::io::Error::other("no regular file"));
        }
        let mut bytes = Vec::new();
        std::fs::File::open(&file)?.take(length as u64).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    read().map_err(|error| wrong(format!("its buffer {}: {error}", file.display())))
}

/// What was read so far.
struct Gathered {
    buffers: Vec<Vec<u8>>,
    /// Bytes in them.
    held: usize,
    /// Bytes of them that were used, each as often as it was.
    taken: usize,
    parsed: Parsed,
}

impl Gathered {
    fn add(&mut self, primitive: &Primitive<'_>, pose: &Matrix4<f64>) -> Result<(), Malformed> {
        let Some(positions) = primitive.get(&Semantic::Positions) else { return Ok(()) };
        if (positions.data_type(), positions.dimensions()) != (DataType::F32, Dimensions::Vec3) {
            return malformed(Place::File, "positions are no vectors of three floats");
        }
        let count = positions.count();
        let index_bytes = match primitive.indices() {
            None => 0,
            Some(indices) => indices.count().saturating_mul(indices.size().max(1)),
        };
        self.take(index_bytes)?;
        let corners: Vec<usize> = match primitive.indices() {
            None => {
                self.values(&positions, POSITION)?;
                (0..count).collect()
            }
            Some(indices) => self.indices(&indices)?,
        };
        if let Some(index) = corners.iter().find(|&&index| index >= count) {
            return malformed(Place::File, format!("index {index} names none of {count} vertices"));
        }
        // Others may use the rest of the vertices.
        let mut used = corners.clone();
        used.sort_unstable();
        used.dedup();
        self.take(used.len().saturating_mul(POSITION))?;
        let from = self.parsed.points.len();
        let mut points = Vec::with_capacity(used.len());
        let values = self.values(&positions, POSITION)?;
        for &index in &used {
            let at = values.get(index);
            let number =
                |i: usize| f64::from(f32::from_le_bytes([at[i], at[i + 1], at[i + 2], at[i + 3]]));
            let p = pose * Point3::new(number(0), number(4), number(8)).to_homogeneous();
            points.push(Point3::new(p.x, p.y, p.z));
        }
        self.parsed.points.append(&mut points);
        let corner = |i: usize| from + used.partition_point(|&index| index < corners[i]);
        // What a node mirrors would look inwards.
        let mirrors = pose.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        let triangle = |i: usize, j: usize, k: usize| {
            let (j, k) = if mirrors { (k, j) } else { (j, k) };
            [corner(i), corner(j), corner(k)]
        };
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

    /// Counts bytes that are read of the buffers, anew each time that a node uses them again.
    fn take(&mut self, bytes: usize) -> Result<(), Malformed> {
        self.taken = self.taken.saturating_add(bytes);
        if self.taken <= self.held.saturating_add(SHARED) {
            return Ok(());
        }
        let cause = format!(
            "its nodes share {} bytes of buffers so often that more than {SHARED} more are made of them",
            self.held
        );
        malformed(Place::File, cause)
    }

    /// The bytes of each value of an accessor.
    fn values(&self, accessor: &Accessor<'_>, size: usize) -> Result<Values<'_>, Malformed> {
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
            (Some(part), Some(needed)) if needed <= part.len() => Ok(Values { part, stride, size }),
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
        let values = self.values(accessor, size)?;
        Ok((0..accessor.count()).map(|i| whole(values.get(i))).collect())
    }
}

/// The values of an accessor, one in each stride of a buffer; as many are there as it counts.
struct Values<'a> {
    part: &'a [u8],
    stride: usize,
    size: usize,
}

impl Values<'_> {
    fn get(&self, i: usize) -> &[u8] {
        &self.part[i * self.stride..i * self.stride + self.size]
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Format, ReadOptions, read_bytes};
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

    /// The square's points with a buffer in a file of that name.
    fn beside(folder: &Path, uri: &str) -> Result<Parsed, Malformed> {
        let json = square().0.replace("BUFFER", &format!("\"uri\":\"{uri}\","));
        parse(json.as_bytes(), &folder.join("x.gltf"))
    }

    #[test]
    fn buffers_are_regular_files_beside_the_file_and_as_long_as_they_say() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("model");
        std::fs::create_dir_all(root.join("parts")).unwrap();
        let data = square().1;
        std::fs::write(root.join("parts/my mesh.bin"), &data).unwrap();
        std::fs::write(folder.path().join("other.bin"), &data).unwrap();
        for uri in ["parts/my%20mesh.bin", "./parts/my mesh.bin"] {
            assert_eq!(beside(&root, uri).unwrap().points.len(), 4, "{uri}");
        }
        let absolute = folder.path().join("other.bin");
        for uri in ["../other.bin", "parts/%2e%2e/../other.bin", absolute.to_str().unwrap()] {
            let cause = beside(&root, uri).unwrap_err().cause;
            assert!(cause.contains("beside it or below"), "{uri}: {cause}");
        }
        assert!(beside(&root, "parts/%ff.bin").unwrap_err().cause.contains("utf-8"));
        assert!(beside(&root, "parts").unwrap_err().cause.contains("no regular file"));
        std::os::unix::fs::symlink("/dev/zero", root.join("zero.bin")).unwrap();
        assert!(beside(&root, "zero.bin").unwrap_err().cause.contains("no regular file"));
        std::fs::write(root.join("short.bin"), &data[..59]).unwrap();
        let cause = beside(&root, "short.bin").unwrap_err().cause;
        assert!(cause.contains("60 bytes is announced, 59"), "{cause}");
    }

    /// The square in a file by itself, with other words in it.
    fn square_with(from: &str, to: &str) -> Result<Parsed, Malformed> {
        let (json, data) = square();
        assert!(json.contains(from));
        let uri = format!("\"uri\":\"data:;base64,{}\",", STANDARD.encode(data));
        parse(json.replace("BUFFER", &uri).replace(from, to).as_bytes(), Path::new("x.gltf"))
    }

    #[test]
    fn what_a_node_mirrors_is_wound_the_other_way() {
        let mirrored = square_with("\"translation\":[2,0,0]", "\"scale\":[-1,1,1]").unwrap();
        assert_eq!(mirrored.triangles, [[0, 1, 2], [0, 2, 3]]);
        let twice = square_with("\"translation\":[2,0,0]", "\"scale\":[-1,1,-1]").unwrap();
        assert_eq!(twice.triangles, [[0, 2, 1], [0, 3, 2]]);
    }

    #[test]
    fn a_mesh_that_many_nodes_share_is_bounded_and_a_shared_buffer_is_read_once() {
        let shared = |nodes: usize| {
            let (points, bytes) = (100_000, 1_200_000);
            let all =
                |text: &dyn Fn(usize) -> String| (0..nodes).map(text).collect::<Vec<_>>().join(",");
            let json = format!(
                "{{\"asset\":{{\"version\":\"2.0\"}},\"scenes\":[{{\"nodes\":[{}]}}],\"nodes\":[{}],\
                 \"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}},\"mode\":0}}]}}],\
                 \"buffers\":[{{\"uri\":\"data:;base64,{}\",\"byteLength\":{bytes}}}],\
                 \"bufferViews\":[{{\"buffer\":0,\"byteLength\":{bytes}}}],\
                 \"accessors\":[{{\"bufferView\":0,\"componentType\":5126,\"count\":{points},\
                 \"type\":\"VEC3\",\"min\":[0,0,0],\"max\":[0,0,0]}}]}}",
                all(&|i| i.to_string()),
                all(&|_| "{\"mesh\":0}".into()),
                STANDARD.encode(vec![0; bytes]),
            );
            parse(json.as_bytes(), Path::new("x.gltf"))
        };
        assert_eq!(shared(3).unwrap().points.len(), 300_000);
        let cause = shared(2 + SHARED / 1_200_000).unwrap_err().cause;
        assert!(cause.contains("so often"), "{cause}");
        // Two primitives of one buffer, each of one triangle: no vertex is there that neither uses.
        let first = "{\"attributes\":{\"POSITION\":0},\"indices\":1}";
        let half = square_with("\"count\":6", "\"count\":3").unwrap();
        assert_eq!((half.points.len(), half.triangles), (3, vec![[0, 2, 1]]));
        let points = "{\"attributes\":{\"POSITION\":0},\"mode\":0}";
        let both = square_with(first, &format!("{first},{points}")).unwrap();
        assert_eq!((both.points.len(), both.triangles.len()), (8, 2));
    }

    #[test]
    fn points_beside_a_mesh_are_told() {
        let first = "{\"attributes\":{\"POSITION\":0},\"indices\":1}";
        let points = "{\"attributes\":{\"POSITION\":0},\"mode\":0}";
        let (json, data) = square();
        let uri = format!("\"uri\":\"data:;base64,{}\",", STANDARD.encode(data));
        let json = json.replace("BUFFER", &uri).replace(first, &format!("{first},{points}"));
        let (path, options) = (Path::new("x.gltf"), ReadOptions::default());
        let raw = read_bytes(json.as_bytes(), Format::Gltf, path, &options).unwrap();
        assert!(raw.warnings.contains(&ScanWarning::NoFace { points: 4 }), "{:?}", raw.warnings);
        assert_eq!(raw.sensor, None);
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
