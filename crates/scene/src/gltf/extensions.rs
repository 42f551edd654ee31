//! Which extensions a scene may require.

use super::error::UnsupportedExtension;
use super::json::At;
use super::notes::Notes;

/// Extensions that are imported.
const SUPPORTED: &[&str] = &[
    "EXT_lights_area",
    "EXT_lights_ies",
    "EXT_lights_image_based",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_ktx",
    "KHR_texture_transform",
];

/// Extensions that only refine shading or describe the file: the scene is right without them, if plainer.
const HARMLESS: &[&str] = &[
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Looks through `extensionsRequired` and `extensionsUsed`: notes what is ignored and returns what cannot be
/// ignored.
pub(super) fn check(root: &At, notes: &mut Notes) -> Vec<UnsupportedExtension> {
    let names = |key: &str| -> Vec<&str> {
        let texts = root.items(key).into_iter().filter_map(|item| {
            let text = item.value.as_str();
            if text.is_none() {
                item.fault("must be a string");
            }
            text
        });
        texts.collect()
    };
    let (required, mut used) = (names("extensionsRequired"), names("extensionsUsed"));
    used.extend(&required);
    used.sort_unstable();
    used.dedup();
    let mut unsupported = Vec::new();
    for name in used {
        if name == "KHR_materials_iridescence" {
            notes.say(format!(
                "{name}: films have the mean of their colours over all angles"
            ));
        }
        if SUPPORTED.contains(&name) {
            continue;
        }
        if required.contains(&name) && !HARMLESS.contains(&name) {
            unsupported.push(UnsupportedExtension {
                name: name.to_owned(),
                advice: advice(name),
            });
            continue;
        }
        notes.say(format!("{name} is ignored"));
    }
    unsupported
}

/// What to do about an extension that cannot be imported. The commands are those of glTF Transform 4
/// (npm package @gltf-transform/cli).
pub(super) fn advice(name: &str) -> String {
    match name {
        "EXT_texture_avif" => "turn the textures into PNG with `gltf-transform png IN.glb OUT.glb`".into(),
        "MSFT_texture_dds" => "export the textures as PNG or JPEG".into(),
        _ => {
            "export the scene without it, or drop it from extensionsRequired if the scene is right without it"
                .into()
        }
    }
}
