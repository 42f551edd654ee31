//! An asset line by line, as `tests/reader/dump.py` prints it: name, type, shape, bytes.

use relight_format::*;
use xxhash_rust::xxh3::xxh3_64;

/// The lines so far.
#[derive(Default)]
struct Dump(Vec<String>);

fn bits<const N: usize>(values: &[[f32; N]]) -> Vec<u8> {
    values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect()
}

impl Dump {
    fn line(&mut self, name: &str, kind: &str, shape: &[usize], bytes: &[u8]) {
        let shape: Vec<String> = shape.iter().map(usize::to_string).collect();
        let content = if bytes.len() <= 256 {
            bytes.iter().map(|byte| format!("{byte:02x}")).collect()
        } else {
            format!("xxh3:{:016x}", xxh3_64(bytes))
        };
        self.0
            .push(format!("{name} {kind}[{}] {content}", shape.join(",")));
    }

    fn number(&mut self, name: &str, value: u64) {
        self.0.push(format!("{name} {value}"));
    }

    fn none(&mut self, name: &str) {
        self.0.push(format!("{name} none"));
    }

    fn text(&mut self, name: &str, value: &[u8]) {
        self.line(name, "text", &[value.len()], value);
    }

    fn f32(&mut self, name: &str, values: &[f32]) {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.line(name, "f32", &[values.len()], &bytes);
    }

    fn vectors<const N: usize>(&mut self, name: &str, values: &[[f32; N]]) {
        self.line(name, "f32", &[values.len(), N], &bits(values));
    }

    fn u32(&mut self, name: &str, values: impl IntoIterator<Item = u32>) {
        let bytes: Vec<u8> = values.into_iter().flat_map(u32::to_le_bytes).collect();
        self.line(name, "u32", &[bytes.len() / 4], &bytes);
    }

    fn list<T>(&mut self, name: &str, items: &[T], mut each: impl FnMut(&mut Self, &str, &T)) {
        self.0.push(format!("{name} list[{}]", items.len()));
        for (i, item) in items.iter().enumerate() {
            each(self, &format!("{name}.{i}"), item);
        }
    }

    fn pair(&mut self, name: &str, first: &str, second: impl FnOnce(&mut Self, &str)) {
        self.0.push(format!("{name} list[2]"));
        self.text(&format!("{name}.0"), first.as_bytes());
        second(self, &format!("{name}.1"));
    }

    fn provenance(&mut self, p: &Provenance) {
        self.text("provenance.tool_version", p.tool_version.as_bytes());
        self.list("provenance.settings", &p.settings, |dump, name, (key, value)| {
            dump.pair(name, key, |dump, name| dump.text(name, value.as_bytes()));
        });
        self.number("provenance.source_hash", p.source_hash);
        self.number("provenance.seed", p.seed);
        self.number("provenance.lambert", p.lambert.into());
        self.list("provenance.left_out", &p.left_out, |dump, name, left| {
            dump.text(&format!("{name}.what"), left.what.as_bytes());
            dump.text(&format!("{name}.why"), left.why.as_bytes());
            dump.number(&format!("{name}.saved_bytes"), left.saved_bytes);
        });
        self.list("provenance.counts", &p.counts, |dump, name, (key, value)| {
            dump.pair(name, key, |dump, name| dump.number(name, *value));
        });
        self.list("provenance.notes", &p.notes, |dump, name, note| {
            dump.text(name, note.as_bytes());
        });
    }

    fn mesh(&mut self, name: &str, mesh: &Mesh) {
        let of = |part: &str| format!("{name}.{part}");
        self.number(&of("material"), mesh.material.into());
        self.vectors(&of("positions"), &mesh.positions);
        match &mesh.normals {
            Some(normals) => self.vectors(&of("normals"), normals),
            None => self.none(&of("normals")),
        }
        self.list(&of("uvs"), &mesh.uvs, |dump, name, uvs| dump.vectors(name, uvs));
        match &mesh.colors {
            Some(colors) => self.vectors(&of("colors"), colors),
            None => self.none(&of("colors")),
        }
        match &mesh.tangents {
            Some(tangents) => self.vectors(&of("tangents"), tangents),
            None => self.none(&of("tangents")),
        }
        let indices: Vec<u8> = mesh
            .triangles
            .iter()
            .flatten()
            .flat_map(|i| i.to_le_bytes())
            .collect();
        self.line(&of("triangles"), "u32", &[mesh.triangles.len(), 3], &indices);
    }

    fn material(&mut self, name: &str, m: &Material) {
        let of = |part: &str| format!("{name}.{part}");
        self.text(&of("name"), m.name.as_bytes());
        self.f32(&of("base_color"), &m.base_color);
        self.f32(&of("metallic"), &[m.metallic]);
        self.f32(&of("roughness"), &[m.roughness]);
        self.f32(&of("emissive"), &m.emissive);
        let mode = of("alpha_mode");
        let (variant, cutoff) = match m.alpha_mode {
            AlphaMode::Opaque => (0, None),
            AlphaMode::Mask(cutoff) => (1, Some(cutoff)),
            AlphaMode::Blend => (2, None),
            AlphaMode::Pane(share) => (3, Some(share)),
        };
        self.0.push(format!("{mode} list[2]"));
        self.number(&format!("{mode}.0"), variant);
        match cutoff {
            Some(cutoff) => self.f32(&format!("{mode}.1"), &[cutoff]),
            None => self.none(&format!("{mode}.1")),
        }
        self.number(&of("double_sided"), m.double_sided.into());
        self.number(&of("unlit"), m.unlit.into());
        self.f32(&of("normal_scale"), &[m.normal_scale]);
        for (part, texture) in [
            ("base_color_texture", &m.base_color_texture),
            ("metallic_roughness_texture", &m.metallic_roughness_texture),
            ("normal_texture", &m.normal_texture),
            ("emissive_texture", &m.emissive_texture),
        ] {
            self.texture_ref(&of(part), texture.as_ref());
        }
    }

    fn texture_ref(&mut self, name: &str, texture: Option<&TextureRef>) {
        let Some(texture) = texture else {
            self.none(name);
            return;
        };
        self.number(&format!("{name}.texture"), texture.texture.into());
        self.number(&format!("{name}.uv_set"), texture.uv_set.into());
        self.f32(&format!("{name}.transform"), &texture.transform);
    }

    fn extensions(&mut self, name: &str, e: &MaterialExtensions) {
        let of = |part: &str| format!("{name}.extensions.{part}");
        for (part, values) in [
            ("ior", &[e.ior][..]),
            ("specular", &[e.specular][..]),
            ("specular_color", &e.specular_color[..]),
            ("clearcoat", &[e.clearcoat][..]),
            ("clearcoat_roughness", &[e.clearcoat_roughness][..]),
            ("clearcoat_normal_scale", &[e.clearcoat_normal_scale][..]),
            ("sheen_color", &e.sheen_color[..]),
            ("sheen_roughness", &[e.sheen_roughness][..]),
            ("anisotropy", &[e.anisotropy][..]),
            ("anisotropy_rotation", &[e.anisotropy_rotation][..]),
            ("iridescence", &[e.iridescence][..]),
            ("iridescence_ior", &[e.iridescence_ior][..]),
            ("iridescence_thickness", &e.iridescence_thickness[..]),
        ] {
            self.f32(&of(part), values);
        }
        for (part, texture) in [
            ("specular_texture", &e.specular_texture),
            ("specular_color_texture", &e.specular_color_texture),
            ("clearcoat_texture", &e.clearcoat_texture),
            ("clearcoat_roughness_texture", &e.clearcoat_roughness_texture),
            ("clearcoat_normal_texture", &e.clearcoat_normal_texture),
            ("sheen_color_texture", &e.sheen_color_texture),
            ("sheen_roughness_texture", &e.sheen_roughness_texture),
            ("anisotropy_texture", &e.anisotropy_texture),
            ("iridescence_texture", &e.iridescence_texture),
            ("iridescence_thickness_texture", &e.iridescence_thickness_texture),
        ] {
            self.texture_ref(&of(part), texture.as_deref());
        }
    }

    fn glass(&mut self, name: &str, glass: &MaterialGlass) {
        let of = |part: &str| format!("{name}.glass.{part}");
        self.f32(&of("thickness"), &[glass.thickness]);
        self.f32(&of("absorption"), &glass.absorption);
        self.texture_ref(&of("transmission_texture"), glass.transmission_texture.as_deref());
    }

    fn weights(&mut self, name: &str, m: &WeightRows) {
        self.number(&format!("{name}.rows"), m.rows.into());
        self.u32(&format!("{name}.row_offsets"), m.row_offsets.iter().copied());
        self.u32(&format!("{name}.columns"), m.columns.iter().copied());
        self.f32(&format!("{name}.weights"), &m.weights);
        self.f32(&format!("{name}.row_sums"), &m.row_sums);
    }

    fn texture(&mut self, name: &str, t: &Texture) {
        self.0.push(format!("{name}.wrap list[2]"));
        self.number(&format!("{name}.wrap.0"), t.wrap_u as u64);
        self.number(&format!("{name}.wrap.1"), t.wrap_v as u64);
        self.number(&format!("{name}.filter"), t.filter as u64);
        self.text(&format!("{name}.mime"), t.mime.as_bytes());
        self.text(&format!("{name}.image"), &t.bytes);
    }

    fn light_tree(&mut self, tree: &LightTree) {
        self.number("light_tree.height", tree.lights.len().ilog2().into());
        match &tree.lights {
            LightSamples::Environment { order } => self.u32("light_tree.order", order.iter().copied()),
            LightSamples::Surface {
                area,
                positions,
                normals,
            } => {
                self.f32("light_tree.area", &[*area]);
                self.vectors("light_tree.positions", positions);
                self.vectors("light_tree.normals", normals);
            }
        }
    }

    fn cuts(&mut self, cuts: &Cuts, lights: usize) {
        self.number("cuts.height", lights.ilog2().into());
        self.f32("cuts.sigma", &[cuts.sigma]);
        self.f32("cuts.unit", &[cuts.unit]);
        self.u32("cuts.row_offsets", cuts.row_offsets.iter().copied());
        self.u32("cuts.heights", cuts.heights.iter().map(|&h| h.into()));
        self.f32("cuts.values", &cuts.values);
    }
}

/// The lines of an asset, sorted by the names of the sections; empty parts have none, as they have no section.
pub fn lines(asset: &Asset) -> Vec<String> {
    let mut dump = Dump::default();
    if let (Some(cuts), Some(tree)) = (&asset.cuts, &asset.light_tree) {
        dump.cuts(cuts, tree.lights.len());
    }
    if let Some(estimates) = &asset.estimates {
        dump.list("estimates", &estimates.values, |dump, name, (key, value)| {
            dump.pair(name, key, |dump, name| {
                dump.line(name, "f64", &[1], &value.to_le_bytes());
            });
        });
    }
    let geometry = &asset.geometry;
    if !(geometry.meshes.is_empty() && geometry.instances.is_empty()) {
        dump.list("geometry.meshes", &geometry.meshes, Dump::mesh);
        dump.list(
            "geometry.instances",
            &geometry.instances,
            |dump, name, instance| {
                dump.number(&format!("{name}.mesh"), instance.mesh.into());
                dump.f32(&format!("{name}.world_from_mesh"), &instance.world_from_mesh);
            },
        );
    }
    if let Some(tree) = &asset.light_tree {
        dump.light_tree(tree);
    }
    if let Some(bounce) = &asset.bounce {
        dump.number("links_bounce.level", bounce.level.into());
        dump.weights("links_bounce.matrix", &bounce.matrix);
    }
    if let Some(solution) = &asset.solution {
        dump.number("links_solution.level", solution.level.into());
        dump.list("links_solution.channels", &solution.channels, Dump::weights);
    }
    if let Some(links) = &asset.transfer {
        dump.number("links_transfer.receivers", links.receivers.into());
        dump.number("links_transfer.senders", links.senders.into());
        dump.u32("links_transfer.row_offsets", links.row_offsets.iter().copied());
        dump.u32("links_transfer.columns", links.columns.iter().copied());
        dump.vectors("links_transfer.vectors", &links.vectors);
    }
    if !asset.materials.is_empty() {
        dump.0.push(format!("materials list[{}]", asset.materials.len()));
        for (i, material) in asset.materials.iter().enumerate() {
            let name = format!("materials.{i}");
            dump.material(&name, material);
            for further in asset
                .material_extensions
                .iter()
                .filter(|e| e.material as usize == i)
            {
                dump.extensions(&name, further);
            }
            for glass in asset.material_glass.iter().filter(|g| g.material as usize == i) {
                dump.glass(&name, glass);
            }
        }
    }
    if let Some(separations) = &asset.separations {
        dump.u32("parted.points", separations.pairs.iter().map(|pair| pair[0]));
        dump.u32("parted.parents", separations.pairs.iter().map(|pair| pair[1]));
        dump.u32("parted.near", separations.near.iter().copied());
    }
    if !asset.points.is_empty() {
        dump.list("points", &asset.points, |dump, name, level| {
            dump.f32(&format!("{name}.disk_radius"), &[level.disk_radius]);
            dump.f32(&format!("{name}.support_radius"), &[level.support_radius]);
            dump.vectors(&format!("{name}.positions"), &level.positions);
            dump.vectors(&format!("{name}.normals"), &level.normals);
            dump.vectors(&format!("{name}.albedo"), &level.albedo);
            if !level.widenings.is_empty() {
                dump.u32(
                    &format!("{name}.widenings"),
                    level.widenings.iter().map(|&k| k.into()),
                );
            }
        });
    }
    dump.provenance(&asset.provenance);
    if let Some(senders) = &asset.senders {
        dump.u32("senders.counts", senders.counts.iter().copied());
        dump.u32("senders.leaf_of_point", senders.leaf_of_point.iter().copied());
        dump.u32("senders.importance", senders.importance.iter().map(|&i| i.into()));
        dump.list("senders.parents", &senders.parents, |dump, name, parents| {
            dump.u32(name, parents.iter().copied());
        });
    }
    if !asset.stage.json.is_empty() {
        dump.text("stage", asset.stage.json.as_bytes());
    }
    if !asset.textures.is_empty() {
        dump.list("textures", &asset.textures, Dump::texture);
    }
    dump.0
}
