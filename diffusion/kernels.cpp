#include "diffusion/kernels.h"

#include <cstring>
#include <initializer_list>

namespace dofusion::kernels {

extern const Kernels k_generic;
#if defined(__x86_64__)
extern const Kernels k_avx512_bf16, k_avx512, k_avx2;
#endif

const Kernels* by_name(const char* name) {
#if defined(__x86_64__)
  const bool avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq");
  if (!std::strcmp(name, "avx512_bf16"))
    return avx512 && __builtin_cpu_supports("avx512bf16") ? &k_avx512_bf16 : nullptr;
  if (!std::strcmp(name, "avx512")) return avx512 ? &k_avx512 : nullptr;
  if (!std::strcmp(name, "avx2"))
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? &k_avx2 : nullptr;
#endif
  return std::strcmp(name, "generic") ? nullptr : &k_generic;
}

const Kernels& best() {
  static const Kernels& chosen = [&]() -> const Kernels& {
    for (const char* name : {"avx512_bf16", "avx512", "avx2"})
      if (const Kernels* kernels = by_name(name)) return *kernels;
    return k_generic;
  }();
  return chosen;
}

}  // namespace dofusion::kernels
