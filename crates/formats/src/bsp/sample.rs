//! Writes small maps: for tests, and as seeds for fuzzing.

/// The lumps of a map that is being written.
#[derive(Clone, Default)]
pub(crate) struct Sample {
    pub(crate) entities: String,
    textures: Vec<u8>,
    models: Vec<u8>,
    vertices: Vec<u8>,
    mesh_vertices: Vec<u8>,
    faces: Vec<u8>,
    lightmaps: Vec<u8>,
}

/// A vertex: position, texture coordinates, light map coordinates, normal.
pub(crate) type Corner = ([f32; 3], [f32; 2], [f32; 2], [f32; 3]);

fn ints(values: &[i32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

impl Sample {
    /// Adds a texture with its surface flags.
    pub(crate) fn texture(&mut self, name: &str, surface: i32) -> i32 {
        let mut bytes = name.as_bytes().to_vec();
        bytes.resize(64, 0);
        self.textures.extend(bytes);
        self.textures.extend(ints(&[surface, 1]));
        self.textures.len() as i32 / 72 - 1
    }

    /// Adds a page of a single colour.
    pub(crate) fn lightmap(&mut self, color: [u8; 3]) {
        self.lightmaps.extend(color.iter().copied().cycle().take(3 * 128 * 128));
    }

    /// Adds a face of `kind` with its vertices, mesh vertices, and size, if it is a patch.
    pub(crate) fn face(
        &mut self,
        (kind, texture, lightmap): (i32, i32, i32),
        corners: &[Corner],
        mesh: &[i32],
        size: [i32; 2],
    ) {
        let first = [self.vertices.len() as i32 / 44, self.mesh_vertices.len() as i32 / 4];
        for (position, uv, lightmap, normal) in corners {
            self.vertices.extend(floats(position));
            self.vertices.extend(floats(uv));
            self.vertices.extend(floats(lightmap));
            self.vertices.extend(floats(normal));
            self.vertices.extend([64, 32, 16, 255]);
        }
        self.mesh_vertices.extend(ints(mesh));
        let counts = [first[0], corners.len() as i32, first[1], mesh.len() as i32];
        self.faces.extend(ints(&[texture, -1, kind]));
        self.faces.extend(ints(&counts));
        self.faces.extend(ints(&[lightmap, 0, 0, 0, 0]));
        self.faces.extend(floats(&[0.0; 12]));
        self.faces.extend(ints(&size));
    }

    /// A horizontal square that faces up, clockwise from above as the game has it.
    pub(crate) fn floor(&mut self, texture: i32, lightmap: i32, [x, y, z]: [f32; 3], side: f32) {
        let corner = |u: f32, v: f32| {
            let position = [x + u * side, y + v * side, z];
            (position, [u, v], [u, v], [0.0, 0.0, 1.0])
        };
        let corners = [corner(0.0, 0.0), corner(0.0, 1.0), corner(1.0, 1.0), corner(1.0, 0.0)];
        self.face((1, texture, lightmap), &corners, &[0, 1, 2, 0, 2, 3], [0, 0]);
    }

    /// Ends a model with all faces that no other has; the first is the world.
    pub(crate) fn model(&mut self) {
        let records = self.models.as_chunks::<40>().0;
        let before: i32 = records.iter().map(|r| i32::from_le_bytes([r[28], r[29], r[30], r[31]])).sum();
        let count = self.faces.len() as i32 / 104 - before;
        self.models.extend(floats(&[0.0; 6]));
        self.models.extend(ints(&[before, count, 0, 0]));
    }

    /// The file.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut lumps = [const { Vec::new() }; 17];
        lumps[0] = self.entities.clone().into_bytes();
        lumps[1].clone_from(&self.textures);
        lumps[7].clone_from(&self.models);
        lumps[10].clone_from(&self.vertices);
        lumps[11].clone_from(&self.mesh_vertices);
        lumps[13].clone_from(&self.faces);
        lumps[14].clone_from(&self.lightmaps);
        let mut file = b"IBSP".to_vec();
        file.extend(46_i32.to_le_bytes());
        let mut offset = 8 + 8 * 17;
        for lump in &lumps {
            file.extend(ints(&[offset, lump.len() as i32]));
            offset += lump.len() as i32;
        }
        file.extend(lumps.concat());
        file
    }

    /// A map with a face of every kind, a door, a light and a view.
    pub(crate) fn everything() -> Self {
        let mut map = Self {
            entities: "{ classname worldspawn ambient 10 } { classname light origin \"0 0 64\" target t } \
                { classname info_null targetname t origin \"8 0 0\" } { classname light } \
                { classname info_player_start origin \"0 0 24\" angle 90 } { classname func_door model *1 }"
                .into(),
            ..Self::default()
        };
        let stone = map.texture("textures/a/stone", 0);
        let lamp = map.texture("textures/a/lamp", 0);
        let sky = map.texture("textures/a/sky", 4);
        let caulk = map.texture("textures/a/caulk", 0x80);
        map.lightmap([64, 96, 200]);
        map.floor(stone, 0, [0.0, 0.0, 0.0], 64.0);
        map.floor(sky, -1, [0.0, 0.0, 256.0], 64.0);
        map.floor(caulk, -1, [0.0, 0.0, -8.0], 64.0);
        let arch = |x: f32, y: f32| {
            let (u, v) = (x / 2.0, y / 2.0);
            let height = if x == 1.0 { 64.0 } else { 0.0 };
            ([64.0 * x, 64.0 * y, height], [u, v], [u, v], [0.0, 0.0, 1.0])
        };
        let control: Vec<Corner> =
            (0..3).flat_map(|y| (0..3).map(move |x| (x, y))).map(|(x, y)| arch(x as f32, y as f32)).collect();
        map.face((2, stone, 0), &control, &[], [3, 3]);
        map.face((3, lamp, -1), &control[..3], &[0, 1, 2], [0, 0]);
        map.face((4, lamp, -1), &[], &[], [0, 0]);
        map.model();
        map.floor(stone, 0, [128.0, 0.0, 0.0], 32.0);
        map.model();
        map
    }

    /// A script for [`Sample::everything`].
    pub(crate) const SCRIPT: &'static str = "textures/a/lamp\n{\n\tq3map_surfacelight 100\n\tcull none\n\
        \t{\n\t\tmap textures/a/stone.tga\n\t\trgbGen wave sin 0.5 0.5 0 1\n\t}\n\t{\n\t\tmap $lightmap\n\
        \t\tblendFunc filter\n\t}\n\t{\n\t\tclampmap textures/a/stone.tga\n\t\tblendFunc add\n\
        \t\ttcMod scale 2 2\n\t\ttcMod scroll 1 0\n\t}\n}\ntextures/a/sky\n{\n\tsurfaceparm sky\n\
        \tq3map_sun 1 1 0.5 150 30 60\n\tq3map_surfacelight 100\n\tskyParms full 512 -\n\t{\n\
        \t\tmap textures/a/stone.tga\n\t}\n}\n";
}
