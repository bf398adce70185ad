//! tmp
use heliostat_scene::Edit;
pub(crate) enum Lighting {
    Ceiling,
    OneLamp,
}
pub(crate) fn build(_: Lighting) -> Vec<Edit> {
    Vec::new()
}
