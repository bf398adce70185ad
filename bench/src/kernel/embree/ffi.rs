//! The part of Embree 4's C interface that is measured, bound at run time: the one home of `unsafe` in this program.
//!
//! Layouts follow `include/embree4/rtcore_ray.h`, `rtcore_common.h` and `rtcore_scene.h` of Embree 4.4. A library built
//! without instance arrays has the same layout but for the last array of a hit, which it leaves alone.

use std::ffi::{CString, c_char, c_void};
use std::path::Path;
use std::ptr;
use std::sync::Arc;
use std::sync::atomic::{AtomicIsize, Ordering};

use libloading::Library;

type Handle = *mut c_void;
type Packet = unsafe extern "C" fn(*const i32, Handle, *mut c_void, *mut QueryArguments);
type Single = unsafe extern "C" fn(Handle, *mut c_void, *mut QueryArguments);

const INDEX_BUFFER: u32 = 0;
const VERTEX_BUFFER: u32 = 1;
const FORMAT_UINT3: u32 = 0x5003;
const FORMAT_FLOAT3: u32 = 0x9003;
const TRIANGLES: u32 = 0;
const INSTANCE: u32 = 121;
const FORMAT_FLOAT3X4_COLUMN_MAJOR: u32 = 0x9234;
const ALL_FEATURES: u32 = u32::MAX;
const COHERENT: u32 = 1 << 16;
const COMPACT: u32 = 1 << 1;
const NATIVE_RAY16: u32 = 34;
/// `RTC_INVALID_GEOMETRY_ID`, also what a missed ray's primitive keeps.
pub(super) const INVALID: u32 = u32::MAX;

/// `RTCRayHit` (N = 1), `RTCRayHit4`, `RTCRayHit8` and `RTCRayHit16`. The ray comes first, so a pointer to it is also
/// one to `RTCRayN`. The strictest alignment of the four serves all.
#[repr(C, align(64))]
#[derive(Clone, Debug)]
pub(super) struct RayHit<const N: usize> {
    pub(super) origin: [[f32; N]; 3],
    pub(super) near: [f32; N],
    pub(super) direction: [[f32; N]; 3],
    pub(super) time: [f32; N],
    /// The hit's parameter afterwards, −∞ for an occluded ray.
    pub(super) far: [f32; N],
    pub(super) mask: [u32; N],
    pub(super) id: [u32; N],
    pub(super) flags: [u32; N],
    pub(super) normal: [[f32; N]; 3],
    pub(super) u: [f32; N],
    pub(super) v: [f32; N],
    pub(super) primitive: [u32; N],
    pub(super) geometry: [u32; N],
    pub(super) instance: [u32; N],
    pub(super) instance_primitive: [u32; N],
}

impl<const N: usize> RayHit<N> {
    pub(super) const EMPTY: Self = Self {
        origin: [[0.0; N]; 3],
        near: [0.0; N],
        direction: [[0.0; N]; 3],
        time: [0.0; N],
        far: [0.0; N],
        mask: [u32::MAX; N],
        id: [0; N],
        flags: [0; N],
        normal: [[0.0; N]; 3],
        u: [0.0; N],
        v: [0.0; N],
        primitive: [INVALID; N],
        geometry: [INVALID; N],
        instance: [INVALID; N],
        instance_primitive: [INVALID; N],
    };
}

const _: () = assert!(std::mem::offset_of!(RayHit<16>, normal) == 768 && size_of::<RayHit<16>>() == 1344);
const _: () = assert!(std::mem::offset_of!(RayHit<1>, normal) == 48 && size_of::<RayHit<1>>() == 128);

/// `RTCIntersectArguments` with all its optional fields: a library without them reads only what comes before.
#[repr(C)]
pub(super) struct QueryArguments {
    flags: u32,
    features: u32,
    context: *mut c_void,
    filter: *mut c_void,
    user_geometry: *mut c_void,
    min_width_distance_factor: f32,
}

impl QueryArguments {
    pub(super) fn new(coherent: bool) -> Self {
        Self {
            flags: if coherent { COHERENT } else { 0 },
            features: ALL_FEATURES,
            context: ptr::null_mut(),
            filter: ptr::null_mut(),
            user_geometry: ptr::null_mut(),
            min_width_distance_factor: 0.0,
        }
    }
}

macro_rules! api {
    ($($field:ident = $symbol:ident: $type:ty;)*) => {
        /// The functions in use, and the library that holds them.
        pub(super) struct Api {
            $($field: $type,)*
            _library: Library,
        }

        impl Api {
            fn bind(library: Library) -> Result<Self, libloading::Error> {
                // SAFETY: the signatures are those of the public headers of Embree 4.
                unsafe {
                    $(let $field = *library.get::<$type>(concat!(stringify!($symbol), "\0").as_bytes())?;)*
                    Ok(Self { $($field,)* _library: library })
                }
            }
        }
    };
}

api! {
    new_device = rtcNewDevice: unsafe extern "C" fn(*const c_char) -> Handle;
    release_device = rtcReleaseDevice: unsafe extern "C" fn(Handle);
    device_error = rtcGetDeviceError: unsafe extern "C" fn(Handle) -> u32;
    device_property = rtcGetDeviceProperty: unsafe extern "C" fn(Handle, u32) -> isize;
    monitor_memory = rtcSetDeviceMemoryMonitorFunction:
        unsafe extern "C" fn(Handle, unsafe extern "C" fn(*mut c_void, isize, bool) -> bool, *mut c_void);
    new_scene = rtcNewScene: unsafe extern "C" fn(Handle) -> Handle;
    release_scene = rtcReleaseScene: unsafe extern "C" fn(Handle);
    scene_flags = rtcSetSceneFlags: unsafe extern "C" fn(Handle, u32);
    scene_quality = rtcSetSceneBuildQuality: unsafe extern "C" fn(Handle, u32);
    geometry_quality = rtcSetGeometryBuildQuality: unsafe extern "C" fn(Handle, u32);
    commit_scene = rtcCommitScene: unsafe extern "C" fn(Handle);
    new_geometry = rtcNewGeometry: unsafe extern "C" fn(Handle, u32) -> Handle;
    release_geometry = rtcReleaseGeometry: unsafe extern "C" fn(Handle);
    commit_geometry = rtcCommitGeometry: unsafe extern "C" fn(Handle);
    attach_geometry = rtcAttachGeometry: unsafe extern "C" fn(Handle, Handle) -> u32;
    new_buffer = rtcSetNewGeometryBuffer:
        unsafe extern "C" fn(Handle, u32, u32, u32, usize, usize) -> *mut c_void;
    instanced_scene = rtcSetGeometryInstancedScene: unsafe extern "C" fn(Handle, Handle);
    transform = rtcSetGeometryTransform: unsafe extern "C" fn(Handle, u32, u32, *const c_void);
    intersect1 = rtcIntersect1: Single;
    intersect4 = rtcIntersect4: Packet;
    intersect8 = rtcIntersect8: Packet;
    intersect16 = rtcIntersect16: Packet;
    occluded1 = rtcOccluded1: Single;
    occluded4 = rtcOccluded4: Packet;
    occluded8 = rtcOccluded8: Packet;
    occluded16 = rtcOccluded16: Packet;
}

impl Api {
    /// Loads the library for the rest of the program's life: its worker threads may outlive every device.
    pub(super) fn load(path: &Path) -> Result<&'static Self, String> {
        // SAFETY: the initialisers of Embree and of its task library set up their own state and nothing else.
        let library = unsafe { Library::new(path) };
        let api = library.and_then(Self::bind).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(Box::leak(Box::new(api)))
    }
}

/// A device: settings, worker threads and the memory in use.
pub(in crate::kernel) struct Device {
    api: &'static Api,
    handle: Handle,
    bytes: Arc<AtomicIsize>,
}

// SAFETY: Embree's devices may be used from any thread, and the counter is atomic.
unsafe impl Send for Device {}
// SAFETY: as above.
unsafe impl Sync for Device {}

impl Device {
    /// A device with settings as `rtcNewDevice` takes them.
    pub(super) fn new(api: &'static Api, settings: &str) -> Result<Arc<Self>, String> {
        let text = CString::new(settings).map_err(|error| error.to_string())?;
        // SAFETY: a string that ends in zero and lives through the call.
        let handle = unsafe { (api.new_device)(text.as_ptr()) };
        if handle.is_null() {
            // SAFETY: a null device asks for the error of this thread.
            let code = unsafe { (api.device_error)(ptr::null_mut()) };
            return Err(format!("Embree refuses a device with `{settings}` (error {code})"));
        }
        let bytes = Arc::new(AtomicIsize::new(0));
        // SAFETY: the counter lives until the device is released: `Device` owns both.
        unsafe { (api.monitor_memory)(handle, count_bytes, Arc::as_ptr(&bytes).cast_mut().cast()) };
        Ok(Arc::new(Self { api, handle, bytes }))
    }

    /// Bytes that the device holds now: trees, vertices and indices.
    pub(in crate::kernel) fn bytes(&self) -> usize {
        self.bytes.load(Ordering::Relaxed).max(0) as usize
    }

    /// As `major.minor.patch`.
    pub(super) fn version(&self) -> String {
        // SAFETY: a live device and properties that every version has.
        let [major, minor, patch] =
            [1, 2, 3].map(|property| unsafe { (self.api.device_property)(self.handle, property) });
        format!("{major}.{minor}.{patch}")
    }

    /// Whether packets of 16 rays are traced as such.
    pub(super) fn native16(&self) -> bool {
        // SAFETY: a live device and a property that every version has.
        unsafe { (self.api.device_property)(self.handle, NATIVE_RAY16) != 0 }
    }

    fn check(&self, what: &str) -> Result<(), String> {
        // SAFETY: a live device.
        match unsafe { (self.api.device_error)(self.handle) } {
            0 => Ok(()),
            code => Err(format!("Embree fails to {what} (error {code})")),
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: the last reference of ours; scenes hold an `Arc` of the device and so are gone.
        unsafe { (self.api.release_device)(self.handle) };
    }
}

unsafe extern "C" fn count_bytes(counter: *mut c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: the pointer that `Device::new` registered.
    unsafe { (*counter.cast::<AtomicIsize>()).fetch_add(bytes, Ordering::Relaxed) };
    true
}

/// One triangle mesh, committed or waiting for it.
pub(super) struct Scene {
    device: Arc<Device>,
    handle: Handle,
}

// SAFETY: committed scenes may be asked from many threads at once; building takes `&mut self`.
unsafe impl Send for Scene {}
// SAFETY: as above.
unsafe impl Sync for Scene {}

impl Scene {
    /// Copies the mesh into buffers of the device; nothing is built yet. `quality` counts from 0, low.
    pub(super) fn new(
        device: &Arc<Device>,
        positions: &[[f32; 3]],
        indices: &[[u32; 3]],
        quality: u32,
        compact: bool,
    ) -> Result<Self, String> {
        let api = device.api;
        let scene = Self::empty(device, quality, compact);
        // SAFETY: handles are used while they live; the buffers have the size that is copied, and the library pads
        // them to 16 bytes by itself.
        unsafe {
            let geometry = (api.new_geometry)(device.handle, TRIANGLES);
            (api.geometry_quality)(geometry, quality);
            let vertices = (api.new_buffer)(geometry, VERTEX_BUFFER, 0, FORMAT_FLOAT3, 12, positions.len());
            let triangles = (api.new_buffer)(geometry, INDEX_BUFFER, 0, FORMAT_UINT3, 12, indices.len());
            if vertices.is_null() || triangles.is_null() {
                (api.release_geometry)(geometry);
                return Err("Embree has no memory for the mesh".into());
            }
            ptr::copy_nonoverlapping(positions.as_ptr(), vertices.cast(), positions.len());
            ptr::copy_nonoverlapping(indices.as_ptr(), triangles.cast(), indices.len());
            (api.commit_geometry)(geometry);
            (api.attach_geometry)(scene.handle, geometry);
            (api.release_geometry)(geometry);
        }
        device.check("take the mesh").map(|()| scene)
    }

    /// A scene with nothing in it yet.
    pub(super) fn empty(device: &Arc<Device>, quality: u32, compact: bool) -> Self {
        let api = device.api;
        // SAFETY: a live device, and a scene that is used while it lives.
        let handle = unsafe {
            let handle = (api.new_scene)(device.handle);
            (api.scene_flags)(handle, if compact { COMPACT } else { 0 });
            (api.scene_quality)(handle, quality);
            handle
        };
        Self { device: Arc::clone(device), handle }
    }

    /// Places another scene, which is committed, in this one, by a matrix of three rows and four columns, column by
    /// column. Errors show when this scene is committed.
    pub(super) fn add_instance(&mut self, object: &Self, matrix: &[f32; 12]) {
        let api = self.device.api;
        // SAFETY: live handles; the matrix is copied, and the geometry keeps the other scene alive.
        unsafe {
            let geometry = (api.new_geometry)(self.device.handle, INSTANCE);
            (api.instanced_scene)(geometry, object.handle);
            (api.transform)(geometry, 0, FORMAT_FLOAT3X4_COLUMN_MAJOR, matrix.as_ptr().cast());
            (api.commit_geometry)(geometry);
            (api.attach_geometry)(self.handle, geometry);
            (api.release_geometry)(geometry);
        }
    }

    /// Builds the tree.
    pub(super) fn commit(&mut self) -> Result<(), String> {
        // SAFETY: a live scene that nobody else uses.
        unsafe { (self.device.api.commit_scene)(self.handle) };
        self.device.check("build the tree")
    }

    /// Closest hits of N rays, N one of 1, 4, 8 and 16; lanes that are not −1 in `valid` are passed over.
    #[inline(always)]
    pub(super) fn intersect<const N: usize>(
        &self,
        valid: &Valid<N>,
        rays: &mut RayHit<N>,
        arguments: &mut QueryArguments,
    ) {
        let api = self.device.api;
        self.query([api.intersect4, api.intersect8, api.intersect16], api.intersect1, valid, rays, arguments);
    }

    /// As [`Scene::intersect`]: whether anything is hit.
    #[inline(always)]
    pub(super) fn occluded<const N: usize>(
        &self,
        valid: &Valid<N>,
        rays: &mut RayHit<N>,
        arguments: &mut QueryArguments,
    ) {
        let api = self.device.api;
        self.query([api.occluded4, api.occluded8, api.occluded16], api.occluded1, valid, rays, arguments);
    }

    #[inline(always)]
    fn query<const N: usize>(
        &self,
        packets: [Packet; 3],
        single: Single,
        valid: &Valid<N>,
        rays: &mut RayHit<N>,
        arguments: &mut QueryArguments,
    ) {
        const { assert!(N == 1 || N == 4 || N == 8 || N == 16) };
        let rays = ptr::from_mut(rays).cast::<c_void>();
        // SAFETY: a committed scene, rays and masks of the width called, aligned as the header asks (64 bytes).
        unsafe {
            match N {
                1 => single(self.handle, rays, arguments),
                4 => packets[0](valid.0.as_ptr(), self.handle, rays, arguments),
                8 => packets[1](valid.0.as_ptr(), self.handle, rays, arguments),
                _ => packets[2](valid.0.as_ptr(), self.handle, rays, arguments),
            }
        }
    }
}

/// Which lanes are rays (−1) and which are not (0); Embree reads it with aligned loads.
#[repr(C, align(64))]
pub(super) struct Valid<const N: usize>(pub(super) [i32; N]);

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: the only reference.
        unsafe { (self.device.api.release_scene)(self.handle) };
    }
}
