//! How large a file may be, so that a hostile one cannot exhaust the machine.

/// Limits on what a load may take. The defaults let scenes of tens of millions of triangles through.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of one file, also after decompression. Default 2 GiB.
    pub file_bytes: u64,
    /// Bytes of all files read and of all data decoded from them, summed over the load. Default 4 GiB. Growing
    /// arrays may momentarily hold twice what is counted.
    pub memory_bytes: u64,
    /// Vertices of all meshes. Default 100 million.
    pub vertices: u64,
    /// Triangles of all meshes, each mesh once however often it is instanced. Default 200 million.
    pub triangles: u64,
    /// Pixels of one image. Default 2²⁷ (16,384 × 8,192).
    pub image_pixels: u64,
    /// Elements of one glTF accessor that no file holds: without a buffer view it is all zeros. Default 16 million.
    pub zeros: u64,
    /// Nodes of a scene hierarchy. Default 4 million.
    pub nodes: u64,
    /// Levels of a scene hierarchy. Default 1,024.
    pub nesting: u64,
    /// Materials and textures. Default 1 million.
    pub materials: u64,
    /// Detail level of AFF scenes: files of a higher level are left out. Default: what the file says, or 0.
    pub detail_level: Option<u32>,
    /// BSP maps: show the light that is baked into the map instead of lights. Default: no.
    pub lightmaps: bool,
    /// Diagnostics kept; how many more there were is said in one further note. Default 100.
    pub diagnostics: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 2 << 30,
            memory_bytes: 4 << 30,
            vertices: 100_000_000,
            triangles: 200_000_000,
            image_pixels: 1 << 27,
            zeros: 16_000_000,
            nodes: 4_000_000,
            nesting: 1024,
            materials: 1_000_000,
            detail_level: None,
            lightmaps: false,
            diagnostics: 100,
        }
    }
}
