//! Prefetching: asking for memory that will be wanted soon. With `build::parts` the kernel's home of `unsafe`.
//!
//! Traversal is bound by latency once a tree outgrows the caches; the stack knows what comes next.
#![allow(unsafe_code, reason = "no stable safe function prefetches")]

const LINE: usize = 64;

/// Asks for the cache lines of `data[index]`; nothing happens past the end or on machines without the instruction.
#[inline(always)]
pub(crate) fn prefetch<T>(data: &[T], index: usize) {
    let Some(item) = data.get(index) else { return };
    for line in 0..size_of::<T>().div_ceil(LINE) {
        let at = std::ptr::from_ref(item).cast::<i8>().wrapping_add(line * LINE);
        #[cfg(target_arch = "x86_64")]
        // SAFETY: SSE is part of x86-64, and a prefetch is a hint that reads nothing: any address is allowed.
        unsafe {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            _mm_prefetch::<_MM_HINT_T0>(at);
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = at;
    }
}
