#pragma once
#include <cstring>

/// Kernels: free functions over raw pointers that are worth several versions, for the machine at hand to choose from
/// when the program starts. (By what a machine can do: names like "arch=haswell" would choose by its name alone.) The
/// address and thread sanitizers do not know functions that are chosen before they are set up.
#if defined(__GNUC__) && __GNUC__ >= 12 && !defined(__clang__) && defined(__x86_64__) && defined(__linux__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define JACKET_KERNEL __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define JACKET_KERNEL
#endif
/// For what a kernel calls: a function of its own would be compiled for the oldest machine only.
#define JACKET_INLINE inline __attribute__((always_inline))

namespace jacket {

/// Four floats that are computed with at once, by a vector extension that GCC and Clang have for every machine.
using Float4 = float __attribute__((vector_size(16)));

/// The same of doubles. Not for results of functions: machines differ in how these are handed back.
using Double4 = double __attribute__((vector_size(32)));

JACKET_INLINE Float4 load4(const float* from) {
    Float4 result;
    std::memcpy(&result, from, sizeof(result));
    return result;
}

JACKET_INLINE void store4(float* to, Float4 value) {
    std::memcpy(to, &value, sizeof(value));
}

/// The same with 0 in the last place: of a vertex's vector, whose last place must stay 0.
JACKET_INLINE Float4 xyz0(Float4 value) {
    value[3] = 0.0f;
    return value;
}

/// Block times vector. Blocks are nine floats by columns, with three more behind the last one in memory. The last place
/// of the result is anything.
JACKET_INLINE Float4 times(const float* block, Float4 x) {
    return load4(block) * x[0] + load4(block + 3) * x[1] + load4(block + 6) * x[2];
}

/// The columns of the block's transpose.
JACKET_INLINE void loadTransposed(const float* block, Float4 (&to)[3]) {
    for (int c = 0; c < 3; ++c)
        to[c] = __builtin_shufflevector(load4(block + c), load4(block + c + 3), 0, 3, 7, 7);  // one instruction
}

/// The block's transpose times vector: to the bits of `times` for a block that is stored transposed.
JACKET_INLINE Float4 timesTransposed(const float* block, Float4 x) {
    Float4 row[3];
    loadTransposed(block, row);
    return row[0] * x[0] + row[1] * x[1] + row[2] * x[2];
}

}  // namespace jacket
