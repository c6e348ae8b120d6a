//! Numbers in buffers. Everything is checked before it is read: what a file says of its own sizes may be wrong.

use gltf::json::{
    Index,
    accessor::{Accessor, ComponentType, Type},
    validation::Checked,
};

use super::document::{Model, range};

/// Elements that an accessor without data may stand for, all of them 0.
const MOST_WITHOUT_DATA: u64 = 1 << 24;

/// Elements of an accessor, one after the other without gaps.
struct Elements {
    bytes: Vec<u8>,
    component: ComponentType,
    normalized: bool,
}

fn components(kind: Type) -> usize {
    match kind {
        Type::Scalar => 1,
        Type::Vec2 => 2,
        Type::Vec3 => 3,
        Type::Vec4 | Type::Mat2 => 4,
        Type::Mat3 => 9,
        Type::Mat4 => 16,
    }
}

impl Model<'_> {
    /// Vectors of `N` numbers.
    ///
    /// # Errors
    /// What is wrong with the accessor, as a sentence that names it.
    pub(super) fn floats<const N: usize>(&self, index: Index<Accessor>) -> Result<Vec<[f32; N]>, String> {
        let elements = self.elements(index, N)?;
        let size = elements.component.size();
        let number = |bytes: &[u8]| decoded(bytes, elements.component, elements.normalized);
        let vector = |bytes: &[u8]| std::array::from_fn(|i| number(&bytes[i * size..(i + 1) * size]));
        Ok(elements.bytes.chunks_exact(N * size).map(vector).collect())
    }

    /// Indices of vertices.
    ///
    /// # Errors
    /// What is wrong with the accessor, as a sentence that names it.
    pub(super) fn indices(&self, index: Index<Accessor>) -> Result<Vec<u32>, String> {
        let elements = self.elements(index, 1)?;
        match elements.component {
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32 => {
                Ok(elements.bytes.chunks_exact(elements.component.size()).map(whole).collect())
            }
            _ => Err(format!("accessors[{index}] holds no indices: they are whole and not negative")),
        }
    }

    /// The elements of an accessor, with those in their places that stand apart.
    fn elements(&self, index: Index<Accessor>, wanted: usize) -> Result<Elements, String> {
        let at = format!("accessors[{index}]");
        let accessor = self.root.get(index).ok_or_else(|| format!("{at} does not exist"))?;
        let (Checked::Valid(component), Checked::Valid(kind)) = (&accessor.component_type, &accessor.type_) else {
            return Err(format!("{at} is of an unknown type"));
        };
        let component = component.0;
        if components(*kind) != wanted {
            return Err(format!("{at} has {} numbers an element, not {wanted}", components(*kind)));
        }
        let size = wanted * component.size();
        let count = accessor.count.0;
        let mut bytes = match accessor.buffer_view {
            Some(view) => {
                let (data, view) = self.view(view)?;
                let stride = view.byte_stride.map_or(size, |stride| if stride.0 == 0 { size } else { stride.0 });
                spaced(data, accessor.byte_offset.unwrap_or_default().0, stride, size, count)
                    .ok_or_else(|| format!("{at} has {count} elements, which go beyond the end of its buffer view"))?
            }
            None if count <= MOST_WITHOUT_DATA => vec![0; count as usize * size],
            None => return Err(format!("{at} has {count} elements without data")),
        };
        if let Some(sparse) = &accessor.sparse {
            let Checked::Valid(kind) = &sparse.indices.component_type else {
                return Err(format!("{at}.sparse.indices is of an unknown type"));
            };
            let kind = kind.0;
            let read = |view, offset, size| {
                let (data, _) = self.view(view)?;
                spaced(data, offset, size, size, sparse.count.0)
                    .ok_or_else(|| format!("{at}.sparse goes beyond the end of its buffer view"))
            };
            let places = read(sparse.indices.buffer_view, sparse.indices.byte_offset.0, kind.size())?;
            let values = read(sparse.values.buffer_view, sparse.values.byte_offset.0, size)?;
            for (place, value) in places.chunks_exact(kind.size()).map(whole).zip(values.chunks_exact(size)) {
                let place = range(u64::from(place) * size as u64, size as u64).and_then(|range| bytes.get_mut(range));
                place.ok_or_else(|| format!("{at}.sparse has an element beyond its {count}"))?.copy_from_slice(value);
            }
        }
        Ok(Elements { bytes, component, normalized: accessor.normalized })
    }
}

/// Elements of `size` bytes that lie `stride` bytes apart, without their gaps; `None` if they are not all there.
fn spaced(data: &[u8], offset: u64, stride: usize, size: usize, count: u64) -> Option<Vec<u8>> {
    if count == 0 {
        return Some(Vec::new());
    }
    let length = (stride as u64).checked_mul(count - 1)?.checked_add(size as u64)?;
    let data = data.get(range(offset, length)?)?;
    // Elements may lie inside each other, so that there are more bytes in them than in the file: no more than this.
    if stride < size && count > MOST_WITHOUT_DATA {
        return None;
    }
    Some((0..count as usize).flat_map(|i| &data[i * stride..i * stride + size]).copied().collect())
}

/// A whole number of one, two or four bytes.
fn whole(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte))
}

/// One number; `normalized` ones are shares of the largest.
fn decoded(bytes: &[u8], component: ComponentType, normalized: bool) -> f32 {
    let word = whole(bytes);
    let (value, largest) = match component {
        ComponentType::F32 => return f32::from_bits(word),
        ComponentType::U8 => (word as f32, 255.0),
        ComponentType::I8 => (f32::from(word as u8 as i8), 127.0),
        ComponentType::U16 => (word as f32, 65535.0),
        ComponentType::I16 => (f32::from(word as u16 as i16), 32767.0),
        ComponentType::U32 => (word as f32, u32::MAX as f32),
    };
    if normalized { (value / largest).max(-1.0) } else { value }
}
