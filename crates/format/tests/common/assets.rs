//! Assets that reach what `small_asset` does not: every mode, every optional array, numbers at the ends of their ranges.

use super::{completed, small_asset, wall};
use relight_format::*;

/// A number of 0 to 1 from a counter (the splitmix64 finaliser).
fn uniform(index: u64) -> f32 {
    let mut x = index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

fn direction(i: u64) -> [f32; 3] {
    let [x, y, z] = [0, 1, 2].map(|axis| uniform(3 * i + axis) - 0.5);
    let length = (x * x + y * y + z * z).sqrt().max(0.1);
    [x / length, y / length, z / length]
}

fn unit(i: u64) -> [f32; 3] {
    // Vectors shorter than `direction` normalises become an axis.
    let d = direction(i);
    let square: f32 = d.iter().map(|c| c * c).sum();
    if (square - 1.0).abs() < 1e-3 {
        d
    } else {
        [0.0, -1.0, 0.0]
    }
}

/// A scan: neighbouring vertices differ little, which is when byte planes of differences are smaller.
fn scan(vertices: u32) -> Mesh {
    let place = |i: u32| {
        [
            i as f32 * 1e-3 + 3.0,
            uniform(i.into()) * 1e-3,
            -(i as f32) * 1e-4,
        ]
    };
    Mesh {
        positions: (0..vertices).map(place).collect(),
        uvs: vec![
            (0..vertices).map(|i| [i as f32 * 1e-3, 0.25]).collect(),
            vec![[-0.0, f32::MIN_POSITIVE / 2.0]; vertices as usize],
        ],
        // Backwards, so that indices jump and rise again.
        triangles: (2..vertices).rev().map(|i| [i, i - 2, i - 1]).collect(),
        material: 1,
        ..Mesh::default()
    }
}

fn level(disk_radius: f32, count: u64, place: impl Fn(u64) -> [f32; 3]) -> Level {
    Level {
        disk_radius,
        widenings: Vec::new(),
        support_radius: 1.7 * disk_radius,
        positions: (0..count).map(place).collect(),
        normals: (0..count).map(|i| unit(1000 + i)).collect(),
        albedo: (0..count)
            .map(|i| [0, 1, 2].map(|c| uniform(5000 + 3 * i + c)))
            .collect(),
    }
}

fn rows_of(lengths: &[u32], columns: u32) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = vec![0];
    let mut all = Vec::new();
    for (row, &length) in lengths.iter().enumerate() {
        // Spread over the columns, from a place that jumps back and forth.
        let first = (row as u32 * 37) % (columns - length);
        let stride = (columns - first) / length.max(1);
        all.extend((0..length).map(|i| first + i * stride));
        offsets.push(all.len() as u32);
    }
    (offsets, all)
}

fn weights(lengths: &[u32], columns: u32, largest_sum: f32) -> WeightRows {
    let (row_offsets, columns) = rows_of(lengths, columns);
    let mut weights = Vec::new();
    let mut row_sums = Vec::new();
    for (row, pair) in row_offsets.windows(2).enumerate() {
        let raw: Vec<f64> = (pair[0]..pair[1])
            .map(|i| f64::from(uniform(u64::from(i) + 9000)) + 1e-3)
            .collect();
        let total: f64 = raw.iter().sum();
        let sum = if raw.is_empty() {
            0.0
        } else {
            largest_sum * uniform(row as u64 + 70)
        };
        weights.extend(raw.iter().map(|w| (w / total * f64::from(sum)) as f32));
        row_sums.push(sum);
    }
    WeightRows {
        rows: lengths.len() as u32,
        row_offsets,
        columns,
        weights,
        row_sums,
    }
}

/// Points exact, on a grid and on a grid of differences; scans; 300 clusters, more than are remembered; vectors from
/// f32's smallest to its largest; a bounce operator; surface lights and cuts.
pub fn wide_asset() -> Asset {
    let small = small_asset();
    let mut asset = Asset {
        provenance: Provenance {
            tool_version: "relight 0.1.0 – widest".into(),
            settings: vec![("größe".into(), "½ m".into()), (String::new(), String::new())],
            source_hash: u64::MAX,
            seed: 1 << 63,
            lambert: false,
            ..Provenance::default()
        },
        stage: Stage {
            json: "{\"cameras\": [\"Gemüse\"]}".into(),
        },
        estimates: Some(Estimates {
            values: vec![("tiny".into(), -5e-324), ("large".into(), f64::MAX)],
        }),
        textures: vec![
            Texture {
                bytes: vec![0xff, 0xd8, 0xff],
                mime: "image/jpeg".into(),
                ..Texture::default()
            },
            small.textures[0].clone(),
        ],
        ..Asset::default()
    };
    asset.geometry.meshes = vec![small.geometry.meshes[0].clone(), scan(40)];
    asset.geometry.instances = [1, 0, 1]
        .map(|mesh| Instance {
            mesh,
            world_from_mesh: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11].map(|i| i as f32 - 5.5),
        })
        .to_vec();
    let reference = |texture: u32, uv_set: u8| TextureRef {
        texture,
        uv_set,
        transform: [0.5, -1.0, 2.0, 0.0, 1.0, -0.25],
    };
    asset.materials = vec![
        small.materials[0].clone(),
        Material {
            name: "glass".into(),
            base_color: [0.1, 0.2, 0.3, 0.4],
            emissive: [1e30, 0.0, 1e-30],
            alpha_mode: AlphaMode::Blend,
            double_sided: true,
            unlit: true,
            normal_scale: -2.0,
            metallic_roughness_texture: Some(reference(1, 1)),
            normal_texture: Some(reference(0, 7)),
            emissive_texture: Some(reference(1, 0)),
            ..Material::default()
        },
    ];
    asset.points = vec![
        // Too wide for 24 bits of a 256th of the radius: exact.
        level(1e-6, 7, |i| [uniform(i) * 100.0 - 50.0, -0.0, 1e-12]),
        // A row of points: differences are smaller.
        level(0.125, 120, |i| [i as f32 * 0.5 - 30.0, 0.25, uniform(i) * 0.1]),
        level(0.0625, 333, |i| [0, 1, 2].map(|axis| uniform(7 * i + axis) * 4.0)),
    ];
    asset.senders = Some(Senders {
        counts: vec![7, 120, 333],
        // Every cluster in turn, so that the list of 255 forgets, then a few again and again.
        leaf_of_point: (0..333u32)
            .map(|i| if i < 300 { (i * 7) % 333 } else { i % 5 })
            .collect(),
        importance: (0..333u32).map(|i| (i * 11 % 256) as u8).collect(),
        parents: vec![
            (0..120u32).map(|i| i / 20).collect(),
            (0..333u32).map(|i| i % 120).collect(),
        ],
    });
    asset.separations = Some(Separations {
        // Points of the second level with some of the first, of the third with some of both.
        pairs: (7..460u32)
            .step_by(3)
            .flat_map(|point| [[point, point % 7], [point, 7 + point % 120]])
            .filter(|pair| pair[1] < 7 || pair[0] >= 127)
            .collect(),
        near: (0..333).filter(|i| i % 5 == 1).collect(),
    });
    let lengths: Vec<u32> = (0..460).map(|i| if i % 3 == 0 { i % 7 } else { 0 }).collect();
    let (row_offsets, columns) = rows_of(&lengths, 460);
    let magnitude = |i: usize| 2f32.powi((i as i32 * 5) % 252 - 126);
    asset.transfer = Some(Links {
        receivers: 460,
        senders: 460,
        vectors: (0..columns.len())
            .map(|i| match i {
                0 => [f32::MAX, -f32::MAX, 0.0],
                1 => [f32::MIN_POSITIVE, 0.0, -f32::MIN_POSITIVE],
                2 => [0.0; 3],
                _ => direction(20_000 + i as u64).map(|c| c * magnitude(i)),
            })
            .collect(),
        row_offsets,
        columns,
    });
    let lengths: Vec<u32> = (0..120).map(|i| if i % 4 == 1 { 0 } else { i % 6 }).collect();
    asset.bounce = Some(BounceLinks {
        level: 1,
        matrix: weights(&lengths, 120, 1.0),
    });
    asset.light_tree = Some(LightTree { lights: wall() });
    let sites = 333;
    let heads: Vec<Vec<u8>> = (0..sites)
        .map(|i| if i % 7 == 0 { vec![8] } else { vec![(i % 8) as u8] })
        .collect();
    let row_offsets = (0..=sites).collect();
    asset.cuts = Some(completed(Cuts {
        sigma: 0.125,
        unit: 1e-12,
        row_offsets,
        values: (0..sites).map(|i| uniform(800 + u64::from(i)) * 9.0).collect(),
        heights: heads.concat(),
    }));
    asset
}

/// The smallest: provenance alone.
pub fn empty_asset() -> Asset {
    Asset::default()
}

/// What takes fewer bits: one channel of albedo, links with short mantissas.
pub fn short_asset() -> Asset {
    let mut asset = wide_asset();
    for (l, level) in asset.points.iter_mut().enumerate() {
        for (i, albedo) in level.albedo.iter_mut().enumerate() {
            *albedo = [uniform((7000 * l + i) as u64); 3];
        }
    }
    asset.coding = Coding {
        grey: true,
        short_links: true,
    };
    asset
}

/// Has points that are wider than their levels, in a layout of its own.
pub fn widened_asset() -> Asset {
    let mut asset = wide_asset();
    for level in &mut asset.points[1..] {
        level.widenings = (0..level.positions.len()).map(|i| (i % 32) as u8).collect();
    }
    asset
}

/// The small asset with a pane.
pub fn pane_asset() -> Asset {
    let mut asset = small_asset();
    asset.materials[0].alpha_mode = AlphaMode::Pane(0.75);
    asset
}

/// The wide asset with extensions of its last material, and a pane.
pub fn extended_asset() -> Asset {
    let mut asset = wide_asset();
    asset.materials[0].alpha_mode = AlphaMode::Pane(0.5);
    let reference = TextureRef {
        texture: 1,
        uv_set: 0,
        transform: [2.0, 0.0, 0.25, 0.0, 2.0, -0.5],
    };
    asset.material_extensions = vec![MaterialExtensions {
        material: asset.materials.len() as u32 - 1,
        ior: 1.33,
        specular: 0.75,
        specular_color: [0.5, 1.0, 2.0],
        clearcoat: 1.0,
        clearcoat_roughness: 0.125,
        sheen_color: [0.25, 0.5, 1.0],
        sheen_roughness: 0.5,
        anisotropy: 0.625,
        anisotropy_rotation: -1.5,
        iridescence: 0.875,
        iridescence_ior: 1.8,
        iridescence_thickness: [120.0, 550.0],
        clearcoat_normal_texture: Some(Box::new(reference)),
        iridescence_thickness_texture: Some(Box::new(reference)),
        ..MaterialExtensions::default()
    }];
    asset
}

/// The extended asset with solid glass and a texture of transmission.
pub fn glass_asset() -> Asset {
    let mut asset = extended_asset();
    let texture = asset.material_extensions[0].clearcoat_normal_texture.clone();
    asset.material_glass = vec![MaterialGlass {
        material: 0,
        thickness: 0.25,
        absorption: [0.0, 0.5, 12.0],
        transmission_texture: texture,
    }];
    asset
}
