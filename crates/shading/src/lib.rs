//! What a hit looks like: surfaces, lights, cameras, environments, textures and samplers.
#![forbid(unsafe_code)]
