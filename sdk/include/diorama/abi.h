// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

/// Number of the plugin interface. It moves whenever a public header changes in a way that a
/// compiled plugin could notice (sdk/docs/abi_policy.md); the host loads exact matches only.
#define DIORAMA_SDK_ABI 1

#define DIORAMA_SDK_API __attribute__((visibility("default")))

// What components are and what they throw is found out at run time, across library borders.
#if !defined(__cpp_rtti) || !defined(__cpp_exceptions)
#error \
    "Diorama's plugins are built with run-time type information and exceptions: remove -fno-rtti and -fno-exceptions"
#endif

#define DIORAMA_DETAIL_TEXT2(x) #x
#define DIORAMA_DETAIL_TEXT(x) DIORAMA_DETAIL_TEXT2(x)

// GCC has macros for its sanitizers, clang before 20 features.
#if defined(__has_feature)
#define DIORAMA_DETAIL_HAS_FEATURE(name) __has_feature(name)
#else
#define DIORAMA_DETAIL_HAS_FEATURE(name) 0
#endif
#if defined(__SANITIZE_ADDRESS__) || DIORAMA_DETAIL_HAS_FEATURE(address_sanitizer)
#define DIORAMA_DETAIL_ADDRESS_SANITIZER 1
#else
#define DIORAMA_DETAIL_ADDRESS_SANITIZER 0
#endif
#if defined(__SANITIZE_THREAD__) || DIORAMA_DETAIL_HAS_FEATURE(thread_sanitizer)
#define DIORAMA_DETAIL_THREAD_SANITIZER 1
#else
#define DIORAMA_DETAIL_THREAD_SANITIZER 0
#endif

#if DIORAMA_DETAIL_ADDRESS_SANITIZER
#define DIORAMA_DETAIL_SANITIZER "address"
#elif DIORAMA_DETAIL_THREAD_SANITIZER
#define DIORAMA_DETAIL_SANITIZER "thread"
#else
#define DIORAMA_DETAIL_SANITIZER "none"
#endif

#if defined(__clang__)
#define DIORAMA_DETAIL_COMPILER __VERSION__
#else
#define DIORAMA_DETAIL_COMPILER "g++ " __VERSION__
#endif

#if defined(_GLIBCXX_DEBUG)
#define DIORAMA_DETAIL_STL "debug"
#elif defined(_GLIBCXX_USE_CXX11_ABI) && _GLIBCXX_USE_CXX11_ABI == 0
#define DIORAMA_DETAIL_STL "old"
#else
#define DIORAMA_DETAIL_STL "cxx11"
#endif
