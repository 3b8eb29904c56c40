#pragma once
#include <atomic>
#include <cstdlib>
#include <new>

/// Counts what a program asks for, from malloc and by new. Replaces both: for one source file of a program.
inline std::atomic<long> allocations{0};

inline void* countedMemory(std::size_t size) {
    ++allocations;
    if (void* memory = std::malloc(size)) return memory;
    throw std::bad_alloc();
}

// Eigen and Bullet allocate with malloc, which glibc lets us stand before.
extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* __libc_realloc(void* memory, std::size_t size);
extern "C" void* malloc(std::size_t size) {
    ++allocations;
    return __libc_malloc(size);
}
extern "C" void* realloc(void* memory, std::size_t size) {
    ++allocations;
    return __libc_realloc(memory, size);
}
void* operator new(std::size_t size) {
    return countedMemory(size);
}
void* operator new[](std::size_t size) {
    return countedMemory(size);
}
void operator delete(void* memory) noexcept {
    std::free(memory);
}
void operator delete[](void* memory) noexcept {
    std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
    std::free(memory);
}
void operator delete[](void* memory, std::size_t) noexcept {
    std::free(memory);
}
