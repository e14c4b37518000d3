/* ψ and the principal stresses p_i = ∂ψ/∂s_i.
 *
 * From the formulas of ψ these carry an absolute error of rounding, all of their digits at a strain of 1e-16.
 * Near rest they are therefore integrals of the second derivatives along the straight line from s = 1, with
 * e = s - 1 known to full precision:
 *
 *   p_i = p_i(1) + Σ_j ∫₀¹ ψ_ij(1 + t e) dt e_j,     ψ = ψ(1) + Σ p_i(1) e_i + Σ e_i e_j ∫₀¹ (1 - t) ψ_ij(1 + t e) dt.
 *
 * ψ(1) and p(1) are zero, and taken as zero where they are zero up to rounding.
 */

/* Gauss-Legendre rules on [0, 1], exact to rounding for strains up to the limit beside them. */
struct rule
{
  int points;
  double limit, t[5], weight[5];
};
static const struct rule rules[3] = {
    {2, 4e-6, {0.21132486540518711775, 0.78867513459481288225}, {0.5, 0.5}},
    {3,
     1e-3,
     {0.11270166537925831148, 0.5, 0.88729833462074168852},
     {0.27777777777777777778, 0.44444444444444444444, 0.27777777777777777778}},
    {5,
     4e-2,
     {0.046910077030668003601, 0.23076534494715845448, 0.5, 0.76923465505284154552, 0.9530899229693319964},
     {0.11846344252809454376, 0.23931433524968323402, 0.28444444444444444444, 0.23931433524968323402,
      0.11846344252809454376}}};

static inline mask near_rest(const struct frame *f)
{
  return larger(magnitude(f->e[0]), larger(magnitude(f->e[1]), magnitude(f->e[2]))) < rules[2].limit;
}

/* ψ(1) and p(1), free of rounding; the stress is the same in the three directions. */
static inline void at_rest(const double *c, double *psi, double *p)
{
  static const double one[3] = {1, 1, 1};
  double value[VALUES];
  density_at(one, one, c, value);
  const double noise = 1e-11 * (fabs(value[4]) + fabs(value[5]));
  *psi = fabs(value[0]) > noise ? value[0] : 0;
  *p = fabs(value[1]) > noise ? value[1] : 0;
}

static inline const struct rule *rule_for(const struct frame *f, mask near)
{
  lanes size = larger(magnitude(f->e[0]), larger(magnitude(f->e[1]), magnitude(f->e[2])));
  size = choose(near, size, all(0));
  if (!any(size > rules[0].limit))
    return &rules[0];
  return any(size > rules[1].limit) ? &rules[2] : &rules[1];
}

/* Where `near`, replaces ψ and p by the integrals. */
static __attribute__((noinline)) void from_rest(const struct frame *f, const double *c, mask near, struct jet *out)
{
  double psi0, p0;
  at_rest(c, &psi0, &p0);
  const struct rule *rule = rule_for(f, near);
  lanes psi = psi0 + p0 * (f->e[0] + f->e[1] + f->e[2]), p[3];
  for (int i = 0; i < 3; ++i)
    p[i] = all(p0);
  for (int n = 0; n < rule->points; ++n)
  {
    struct jet jet = *out;
    lanes s[3];
    for (int i = 0; i < 3; ++i)
      s[i] = 1 + rule->t[n] * f->e[i];
    density_ph(s, f->s, c, near, &jet);
    for (int i = 0; i < 3; ++i)
    {
      const lanes change = rule->weight[n] * (jet.h[i][0] * f->e[0] + jet.h[i][1] * f->e[1] + jet.h[i][2] * f->e[2]);
      p[i] += change;
      psi += (1 - rule->t[n]) * f->e[i] * change;
    }
  }
  out->psi = choose(near, psi, out->psi);
  for (int i = 0; i < 3; ++i)
    out->p[i] = choose(near, p[i], out->p[i]);
}

static inline void energy_density(const struct frame *f, const double *c, struct jet *out)
{
  const mask near = near_rest(f), far = near == 0;
  if (any(far))
    density_psi(f->s, f->s, c, far, out);
  if (any(near))
    from_rest(f, c, near, out);
#if POSITIVE
  /* Some formulas are finite again, and even zero, on the far side of their barrier. */
  for (int i = 0; i < 3; ++i)
    out->psi = choose(f->s[i] > 0, out->psi, all(NAN));
#endif
}

static inline void principal_stress(const struct frame *f, const double *c, struct jet *out)
{
  const mask near = near_rest(f), far = near == 0;
  if (any(far))
    density_p(f->s, f->s, c, far, out);
  if (any(near))
    from_rest(f, c, near, out);
}
