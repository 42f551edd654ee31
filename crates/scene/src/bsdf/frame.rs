//! The frame of tangent, bitangent and shading normal in which anisotropic lobes lie.

use glam::Vec3;

pub(super) struct Frame {
    tangent: Vec3,
    bitangent: Vec3,
    normal: Vec3,
}

impl Frame {
    /// `tangent` made perpendicular to the unit `normal`; any direction across it where nothing is left.
    pub(super) fn new(normal: Vec3, tangent: Vec3) -> Frame {
        let tangent = (tangent - normal * normal.dot(tangent))
            .try_normalize()
            .unwrap_or_else(|| normal.any_orthonormal_vector());
        Frame {
            tangent,
            bitangent: normal.cross(tangent),
            normal,
        }
    }

    pub(super) fn local(&self, world: Vec3) -> Vec3 {
        Vec3::new(
            self.tangent.dot(world),
            self.bitangent.dot(world),
            self.normal.dot(world),
        )
    }

    pub(super) fn world(&self, local: Vec3) -> Vec3 {
        self.tangent * local.x + self.bitangent * local.y + self.normal * local.z
    }
}
