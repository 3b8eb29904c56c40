#pragma once

/// Kernels: free functions over raw pointers that are worth several versions, for the machine at hand to choose from
/// when the program starts. The address sanitizer does not know functions that are chosen before it is set up.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__) && \
    !defined(__SANITIZE_ADDRESS__)
#define JACKET_KERNEL __attribute__((target_clones("default", "arch=haswell", "arch=skylake-avx512")))
#else
#define JACKET_KERNEL
#endif
/// For what a kernel calls: a function of its own would be compiled for the oldest machine only.
#define JACKET_INLINE inline __attribute__((always_inline))
