"""What others would say of the data of the blind trials, graded as the diagnosis is: sparse regression in weak form
(pysindy), with the diagnosis' own library of terms, and symbolic regression (gplearn)."""
