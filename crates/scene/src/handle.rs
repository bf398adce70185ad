//! Typed handles: what an edit or a hit points at, never a bare integer.

macro_rules! handles {
    ($($(#[$doc:meta])* $name:ident, $what:literal;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(
            /// The number, unique among handles of this type within one scene.
            pub u32,
        );

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, concat!($what, " {}"), self.0)
            }
        }
    )*};
}

handles! {
    /// A [`Geometry`](crate::Geometry).
    GeometryId, "geometry";
    /// An [`Object`](crate::Object).
    ObjectId, "object";
    /// An [`Instance`](crate::Instance).
    InstanceId, "instance";
    /// A [`Material`](crate::Material).
    MaterialId, "material";
    /// A [`Texture`](crate::Texture).
    TextureId, "texture";
    /// A [`Light`](crate::Light).
    LightId, "light";
    /// A [`Camera`](crate::Camera).
    CameraId, "camera";
}
