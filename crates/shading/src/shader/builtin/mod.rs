//! The surface shaders that come with the engine: one file for each family.

mod checker;

use super::ShaderRegistry;

/// Adds them all.
pub(super) fn register(registry: &mut ShaderRegistry) {
    registry.register(checker::Checker);
}
